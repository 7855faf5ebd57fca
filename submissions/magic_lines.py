"""Finds the magic line of a notebook cell, and tells which magics begin a robot program.

Parsing the flags of a magic is in ``magics.py``, which needs the floors and therefore numpy.
"""

from __future__ import annotations

from typing import Literal

from responders.sandbox.inside.cell_source import WRAPPERS

Preamble = Literal["none", "imports", "preloaded"]
#: The magics that begin a robot program, and the names that each defines for it.
PREAMBLES: dict[str, Preamble] = {
    "sim_magic": "none",
    "sim_magic_imports": "imports",
    "sim_magic_preloaded": "preloaded",
}


def magic_place(text: str) -> int | None:
    """The index of the first line that is neither blank nor a comment, if it is a magic; of wrappers the last."""
    found = None
    for place, line in enumerate(text.split("\n")):
        stripped = line.lstrip("\ufeff").strip()
        if not stripped or stripped.startswith("#"):
            continue
        if not stripped.startswith("%"):
            return found
        found = place
        if not stripped.startswith("%%") or magic_name(stripped) not in WRAPPERS:
            return place
    return found


def is_program_magic(line: str) -> bool:
    """Whether a line makes its cell a robot program, as ``%%sim_magic`` does and ``%sim_magic`` does not."""
    stripped = line.lstrip("\ufeff").strip()
    return stripped.startswith("%%") and magic_name(stripped) in PREAMBLES


def magic_name(magic: str) -> str:
    """Return the name of a magic, without its percent signs and flags."""
    return (magic.split(maxsplit=1) or [""])[0].lstrip("%")
