"""The Python files beside a program or a responder, as modules that it can import by their names.

A text can import only what it names on a line with an import. So what is handed over with it is small, and is all that
rules about its code have to read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from sim.errors import UsageError
from submissions.source_text import decode_source

_IMPORTING = re.compile(r"^.*import.*$", re.MULTILINE)
_WORD = re.compile(r"[^\W\d]\w*")
#: What is handed over to one program, characters; as much as one file may have.
_MOST_TEXT = 1 << 20


def modules_of(text: str, read: Callable[[str], bytes | None]) -> Mapping[str, str]:
    """The modules that a text can import, and those that they can, by their names.

    ``read`` gives a file's bytes by its name, or None. One that is no text, or too much with the others, is left out.
    """
    found: dict[str, str] = {}
    looked: set[str] = set()
    left = _MOST_TEXT
    waiting = [text]
    while waiting:
        for name in sorted(_named(waiting.pop()) - looked):
            looked.add(name)
            module = _module(name, read)
            if module is not None and len(module) <= left:
                left -= len(module)
                found[name] = module
                waiting.append(module)
    return found


def _named(text: str) -> set[str]:
    lines = _IMPORTING.findall(text.replace("\\\n", " "))
    return {name for line in lines for name in _WORD.findall(line)}


def _module(name: str, read: Callable[[str], bytes | None]) -> str | None:
    data = read(f"{name}.py")
    if data is None:
        return None
    try:
        return decode_source(data, f"{name}.py").text
    except UsageError:
        return None
