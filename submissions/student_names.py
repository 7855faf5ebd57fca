"""Student names: their displayed form, and detection of names that look the same.

Callers decide how to treat similar names.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from importlib import resources

from submissions.raw_files import sanitise_name

MAX_NAME_LENGTH = 100
#: Joiners are control characters, but emoji and some scripts need them.
_JOINERS = "\u200c\u200d"
#: Letters and symbols that look like spaces.
_BLANKS = "\u115f\u1160\u2800\u3164\uffa0"
#: Invisible marks that Unicode lets programs ignore. Most other invisible characters are control characters.
_INVISIBLE = frozenset(
    "\u034f\u17b4\u17b5" + "".join(map(chr, (*range(0x180B, 0x1810), *range(0xFE00, 0xFE10), *range(0xE0000, 0xE1000))))
)


def normalise_name(text: str) -> str:
    """Return the normalised name on one line without control characters; empty if it has no visible character.

    The name is never used as a path, so it may contain slashes.
    """
    visible_text = "".join(
        " " if c.isspace() else c for c in text if c.isspace() or c in _JOINERS or not _is_control(c)
    )
    name = " ".join(unicodedata.normalize("NFC", visible_text).split()).strip(" " + _JOINERS)
    return name if any(compute_name_forms(name)) else ""


@lru_cache(maxsize=4096)
def compute_name_forms(name: str) -> frozenset[str]:
    """Return the comparison forms of a name. Names with a common form look the same.

    Both forms ignore case, unusual spaces and invisible characters. The second also replaces letters that look like
    Latin letters or digits. Latin letters and digits themselves do not change: Kai and Kal are different students, as
    are a1 and al.
    """
    if name.isascii() and name.isprintable():
        return frozenset([_fold_text(name)])
    letters = (" " if c.isspace() or c in _BLANKS else c for c in unicodedata.normalize("NFKD", name))
    visible_text = "".join(c for c in letters if c not in _INVISIBLE and not _is_control(c))
    return frozenset([_fold_text(visible_text), _fold_text(visible_text.translate(_load_look_alikes()))])


def find_look_alikes(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the names that look like another name, each with some of the others."""
    by_form: dict[str, list[str]] = {}
    distinct_names = list(dict.fromkeys(names))
    for name in distinct_names:
        for form in compute_name_forms(name):
            by_form.setdefault(form, []).append(name)
    look_alikes = {}
    for name in distinct_names:
        similar_names = dict.fromkeys(
            other for form in sorted(compute_name_forms(name)) for other in by_form[form][:4] if other != name
        )
        if similar_names:
            look_alikes[name] = tuple(similar_names)[:3]
    return look_alikes


def describe_look_alikes(similar_names: Sequence[str]) -> str:
    """Return ``cannot be told from x`` with the reason."""
    quoted_names = " and ".join(f'"{sanitise_name(other)}"' for other in similar_names)
    return f"cannot be distinguished from {quoted_names} (case, spaces, and invisible or similar letters do not count)"


def _fold_text(text: str) -> str:
    folded = unicodedata.normalize("NFKD", text.casefold()).replace("i\u0307", "i")
    return " ".join(folded.split()).strip(". ")


def _is_control(character: str) -> bool:
    return unicodedata.category(character)[0] == "C"


@cache
def _load_look_alikes() -> dict[int, str]:
    """Return the letters that look like Latin letters or digits, from Unicode's table of confusables (UTS 39)."""
    table = json.loads(resources.files(__package__).joinpath("look_alikes.json").read_text("utf-8"))
    return {ord(letter): latin for latin, letters in table.items() for letter in letters}
