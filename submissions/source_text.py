"""From the bytes of a Python file, in whatever encoding it was saved, to its text.

Whether the text is Python is for the interpreter to say, inside the sandbox; here it only becomes readable.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

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
