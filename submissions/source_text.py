"""Text of Python files: decoding, the magic line, and the modules that a file can import.

The interpreter inside the sandbox checks the syntax. ``magics.py`` parses the flags, because it needs the floors and
therefore numpy.
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

# PEP 263: the cookie is in the first two lines.
_COOKIE = re.compile(rb"^[ \t\f]*#.*?coding[:=][ \t]*([-\w.]+)", re.ASCII)
_BLANK = re.compile(rb"^[ \t\f]*(?:#.*)?$")
#: Text encodings. A cookie must not select Python's codecs that decompress or interpret data.
_TEXT_ENCODINGS = re.compile(
    r"utf-8|ascii|iso8859-\d+|cp\d+|koi8-[rut]|mac-\w+|big5|gbk|gb18030|gb2312|shift_jis|euc_\w+"
)

_RICH_TEXT = rb"{\rtf"
_NOTEBOOK_KEYS = (b'"cells"', b'"nbformat"')

Preamble = Literal["none", "imports", "preloaded"]
#: The magics that start a robot program, and the names that each defines for it.
PREAMBLES: Mapping[str, Preamble] = MappingProxyType(
    {"sim_magic": "none", "sim_magic_imports": "imports", "sim_magic_preloaded": "preloaded"}
)

_IMPORTING = re.compile(r"^.*import.*$", re.MULTILINE)
_WORD = re.compile(r"[^\W\d]\w*")
#: Limit on the modules of one program in characters, the same as for one file.
_MAX_MODULES_LENGTH = 1 << 20


@dataclass(frozen=True, slots=True)
class DecodedText:
    """The text, and a note on its encoding if it is not plain UTF-8."""

    text: str
    note: str = ""


def decode_source(data: bytes, name: str) -> DecodedText:
    """Decode Python source: UTF-8, a byte order mark, a PEP 263 cookie, otherwise Latin-1.

    Raises:
        UsageError: The source is larger than 1 MB or contains NUL characters, or is rich text or a notebook.
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
    nul_position = decoded.text.find("\0")
    if nul_position >= 0:
        line = decoded.text.count("\n", 0, nul_position) + 1
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
    encoding = _find_encoding_cookie(data)
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


def _find_encoding_cookie(data: bytes) -> str | None:
    """Return the encoding named in the first two lines, if it is a text encoding."""
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


def find_magic_line(text: str) -> int | None:
    """Return the index of the magic before any code; the last one after wrapper magics. None without a magic."""
    magic_index = None
    for index, line in enumerate(text.split("\n")):
        stripped = line.lstrip("\ufeff").strip()
        if not stripped or stripped.startswith("#"):
            continue
        if not stripped.startswith("%"):
            return magic_index
        magic_index = index
        if not stripped.startswith("%%") or parse_magic_name(stripped) not in WRAPPERS:
            return index
    return magic_index


def is_program_magic(line: str) -> bool:
    """Return whether a line makes its cell a robot program: ``%%sim_magic`` does, ``%sim_magic`` does not."""
    stripped = line.lstrip("\ufeff").strip()
    return stripped.startswith("%%") and parse_magic_name(stripped) in PREAMBLES


def parse_magic_name(magic: str) -> str:
    """Return the name of a magic, without its percent signs and flags."""
    return (magic.split(maxsplit=1) or [""])[0].lstrip("%")


def find_modules(text: str, read_file: Callable[[str], bytes | None]) -> Mapping[str, str]:
    """Return the modules that a text can import, directly or through other modules, by name.

    A text can import only names on its import lines, so rules about code read no other files. ``read_file`` returns a
    file's bytes by name, or None. Files that are not text or exceed the common limit are omitted.
    """
    modules: dict[str, str] = {}
    checked_names: set[str] = set()
    remaining_length = _MAX_MODULES_LENGTH
    pending_texts = [text]
    while pending_texts:
        for name in sorted(_find_imported_names(pending_texts.pop()) - checked_names):
            checked_names.add(name)
            module = _read_module(name, read_file)
            if module is not None and len(module) <= remaining_length:
                remaining_length -= len(module)
                modules[name] = module
                pending_texts.append(module)
    return modules


def _find_imported_names(text: str) -> set[str]:
    lines = _IMPORTING.findall(text.replace("\\\n", " "))
    return {name for line in lines for name in _WORD.findall(line)}


def _read_module(name: str, read_file: Callable[[str], bytes | None]) -> str | None:
    data = read_file(f"{name}.py")
    if data is None:
        return None
    try:
        return decode_source(data, f"{name}.py").text
    except UsageError:
        return None
