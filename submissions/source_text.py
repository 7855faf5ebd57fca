"""The text of a Python file: how its bytes are decoded, its magic line, and the modules that it can import.

Whether the text is Python is for the interpreter to say, inside the sandbox. The flags of a magic are parsed in
``magics.py``, which needs the floors and therefore numpy.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from responders.sandbox.inside.cell_source import WRAPPERS
from sim.errors import UsageError

MAX_SOURCE_BYTES = 1024 * 1024

# PEP 263: only the first two lines can hold the cookie.
_COOKIE = re.compile(rb"^[ \t\f]*#.*?coding[:=][ \t]*([-\w.]+)", re.ASCII)
_BLANK = re.compile(rb"^[ \t\f]*(?:#.*)?$")
#: Encodings of text; a cookie must not reach those of Python's that decompress or interpret.
_TEXT_ENCODINGS = re.compile(
    r"utf-8|ascii|iso8859-\d+|cp\d+|koi8-[rut]|mac-\w+|big5|gbk|gb18030|gb2312|shift_jis|euc_\w+"
)

_RICH_TEXT = rb"{\rtf"
_NOTEBOOK_KEYS = (b'"cells"', b'"nbformat"')

Preamble = Literal["none", "imports", "preloaded"]
#: The magics that begin a robot program, and the names that each defines for it.
PREAMBLES: Mapping[str, Preamble] = MappingProxyType(
    {"sim_magic": "none", "sim_magic_imports": "imports", "sim_magic_preloaded": "preloaded"}
)

_IMPORTING = re.compile(r"^.*import.*$", re.MULTILINE)
_WORD = re.compile(r"[^\W\d]\w*")
#: The modules of one program, characters; as much as one file may have.
_MOST_TEXT = 1 << 20


@dataclass(frozen=True, slots=True)
class DecodedText:
    """The text, and a sentence on how it was read where that was not plain UTF-8."""

    text: str
    note: str = ""


def decode_source(data: bytes, name: str) -> DecodedText:
    """UTF-8, a byte order mark, a PEP 263 cookie, else Latin-1, in this order.

    Raises UsageError for more than 1 MB, for NUL characters, which no Python file has, for rich text and for notebooks.
    """
    if len(data) > MAX_SOURCE_BYTES:
        raise UsageError("%(name)s: is too large for a Python file, expected at most 1 MB.", name=name)
    if data.lstrip().startswith(_RICH_TEXT):
        raise UsageError(
            "%(name)s: is a rich text document, expected Python source. In the editor, save it as plain text.",
            name=name,
        )
    if data.lstrip().startswith(b"{") and all(key in data for key in _NOTEBOOK_KEYS):
        raise UsageError(
            "%(name)s: is a notebook, expected Python source. Rename it so that it ends in .ipynb.", name=name
        )
    decoded = _decode(data, name)
    nul = decoded.text.find("\0")
    if nul >= 0:
        line = decoded.text.count("\n", 0, nul) + 1
        raise UsageError(
            "%(name)s: has a NUL character in line %(line)s, expected Python source as plain text.",
            name=name,
            line=line,
        )
    return decoded


def _decode(data: bytes, name: str) -> DecodedText:
    if data.startswith(codecs.BOM_UTF8):
        data = data.removeprefix(codecs.BOM_UTF8)
    elif data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return DecodedText(data.decode("utf-16"), f"{name} was read as UTF-16; save it as UTF-8.")
        except UnicodeDecodeError:
            raise UsageError("%(name)s: is damaged UTF-16 text, expected Python source in UTF-8.", name=name) from None
    encoding = _cookie(data)
    if encoding and encoding != "utf-8":
        try:
            return DecodedText(data.decode(encoding))
        except (UnicodeDecodeError, LookupError):
            pass
    try:
        return DecodedText(data.decode("utf-8"))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        return DecodedText(
            data.decode("latin-1"),
            f"{name} is not UTF-8 (line {line}) and was read as Latin-1; save it as UTF-8.",
        )


def _cookie(data: bytes) -> str | None:
    """The encoding that the first two lines ask for, if it is one of text."""
    for line in data.split(b"\n", 2)[:2]:
        match = _COOKIE.match(line)
        if match:
            try:
                encoding = codecs.lookup(match[1].decode("ascii")).name
            except LookupError:
                return None
            return encoding if _TEXT_ENCODINGS.fullmatch(encoding) else None
        if not _BLANK.match(line.rstrip(b"\r")):
            return None
    return None


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


def modules_of(text: str, read: Callable[[str], bytes | None]) -> Mapping[str, str]:
    """Return the modules that a text can import, and those that they can, by their names.

    A text can import only what it names on a line with an import, so these are also all that rules about its code
    read. ``read`` gives a file's bytes by its name, or None. One that is no text, or too much with the others, is left
    out.
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
