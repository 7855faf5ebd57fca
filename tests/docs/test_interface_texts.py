"""Interface texts are short, and the documentation quotes labels as the pages show them."""

from __future__ import annotations

import re
from functools import cache

import pytest
from babel.messages.pofile import read_po

from paths import DATA, ROOT

pytestmark = pytest.mark.fast

_MOST_WORDS = 25
#: Pages with labels in italics.
_QUOTING = ("tutorial", "web", "students", "instructors", "operators")
#: Emphasis that is no label: names in examples, and labels of other programs.
_NO_LABELS = {
    "tutorial": {"Recognise a shape"},
    "web": {"Participant", "moodle-worksheet", "moodle-feedback"},
    "students": {"Restart Kernel and Run All Cells", "Run"},
    "instructors": {"Offline grading worksheet"},
    "operators": {"grace", "Works", "not tested:", "Other service addresses"},
}


@cache
def _texts() -> tuple[str, ...]:
    """Return the English texts, singular and plural."""
    with (ROOT / "service" / "locale" / "de.po").open("rb") as file:
        ids = [message.id for message in read_po(file) if message.id]
    return tuple(text for each in ids for text in ([each] if isinstance(each, str) else each))


def test_texts_of_the_interface_are_short_except_the_listed_ones() -> None:
    lines = (DATA / "long_interface_texts.txt").read_text(encoding="utf-8").splitlines()
    listed = {line for line in lines if not line.startswith("#")}
    long = {" ".join(text.split()) for text in _texts() if len(text.split()) > _MOST_WORDS}
    assert sorted(long - listed) == [], f"more than {_MOST_WORDS} words"
    assert sorted(listed - long) == [], "listed, but no longer used"


@pytest.mark.long
@pytest.mark.parametrize("page", _QUOTING)
def test_a_label_in_italics_is_one_of_the_interface(page: str) -> None:
    prose = re.sub(r"```.*?```|`[^`\n]*`", "", (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"), flags=re.S)
    quoted = {" ".join(text.split()) for text in re.findall(r"(?<![*\w])\*([^*\n]+(?:\n[^*\n]+)?)\*(?![*\w])", prose)}
    assert sorted(text for text in quoted - _NO_LABELS.get(page, set()) if not _is_label(text)) == []


def _is_label(quoted: str) -> bool:
    return any(re.fullmatch(_pattern(text), quoted) for text in _texts())


@cache
def _pattern(text: str) -> str:
    """Return the regular expression of a text, with anything instead of its parameters."""
    return ".+".join(re.escape(part) for part in re.split(r"%\(\w+\)s", text.rstrip(":")))
