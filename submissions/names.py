"""Students' names: how one is shown, and which cannot be told from one another.

Knows neither files nor courses; what happens to names that are alike is for whoever takes submissions in.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from importlib import resources

from submissions.raw_files import shown

LONGEST_NAME = 100
#: They count as control characters, but emoji and some scripts are written with them.
_JOINERS = "\u200c\u200d"
#: Letters and symbols that are as wide as others and as empty as a space.
_BLANKS = "\u115f\u1160\u2800\u3164\uffa0"
#: Marks that Unicode leaves to a program to ignore; most of what is never seen counts as a control character.
_NEVER_SEEN = frozenset(
    "\u034f\u17b4\u17b5" + "".join(map(chr, (*range(0x180B, 0x1810), *range(0xFE00, 0xFE10), *range(0xE0000, 0xE1000))))
)


def shown_name(text: str) -> str:
    """The one normal form of a name, on one line and without control characters; empty where nothing can be seen.

    It is never a path, so a slash may stay.
    """
    kept = "".join(" " if c.isspace() else c for c in text if c.isspace() or c in _JOINERS or not _is_control(c))
    name = " ".join(unicodedata.normalize("NFC", kept).split()).strip(" " + _JOINERS)
    return name if any(forms(name)) else ""


@lru_cache(maxsize=4096)
def forms(name: str) -> frozenset[str]:
    """What names that are alike have at least one of in common: two forms of a name, or one where they are the same.

    In both, case, odd blanks and invisible characters are gone; the second has, for each letter that looks like a
    Latin one or a digit, that one. Latin letters and digits stand for themselves: Kai and Kal are two students, as are
    a1 and al.
    """
    if name.isascii() and name.isprintable():
        return frozenset([_folded(name)])
    letters = (" " if c.isspace() or c in _BLANKS else c for c in unicodedata.normalize("NFKD", name))
    seen = "".join(c for c in letters if c not in _NEVER_SEEN and not _is_control(c))
    return frozenset([_folded(seen), _folded(seen.translate(_look_alikes()))])


def alike(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Of different names those that cannot be told from others, each with some of those."""
    by_form: dict[str, list[str]] = {}
    different = list(dict.fromkeys(names))
    for name in different:
        for form in forms(name):
            by_form.setdefault(form, []).append(name)
    found = {}
    for name in different:
        near = dict.fromkeys(other for form in sorted(forms(name)) for other in by_form[form][:4] if other != name)
        if near:
            found[name] = tuple(near)[:3]
    return found


def cannot_be_told(others: Sequence[str]) -> str:
    """``cannot be told from x``, and why."""
    listed = " and ".join(f'"{shown(other)}"' for other in others)
    return f"cannot be told from {listed} (case, blanks, and letters that cannot be seen or look alike do not count)"


def _folded(text: str) -> str:
    folded = unicodedata.normalize("NFKD", text.casefold()).replace("i\u0307", "i")
    return " ".join(folded.split()).strip(". ")


def _is_control(character: str) -> bool:
    return unicodedata.category(character)[0] == "C"


@cache
def _look_alikes() -> dict[int, str]:
    """From Unicode's table of confusable characters (UTS 39): the letters that look like Latin ones or digits."""
    table = json.loads(resources.files(__package__).joinpath("look_alikes.json").read_text("utf-8"))
    return {ord(letter): latin for latin, letters in table.items() for letter in letters}
