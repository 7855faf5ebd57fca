"""TOML reader with limits on keys, tables and values.

``tomllib`` keeps every prefix of a dotted key, so its time and memory grow with the square of the number of parts.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from tomllib import TOMLDecodeError
from typing import Any

from sim.readers.reader_errors import TooLongNumberError, TooManyValuesError, UnreadableDataError, check_depth

__all__ = ["MAX_KEY_PARTS", "TOMLDecodeError", "read_toml"]

MAX_KEY_PARTS = 10
#: Reading a key, table or list takes up to 1 kB each.
MAX_KEYS = 20_000
MAX_VALUES = 200_000
#: Strings and comments, matched from the start of the text as in TOML, so that only structure remains. An unterminated
#: string extends to the end of the text or line, which avoids a new search at each later quote.
_TEXTS = re.compile(
    r'"""[^"\\]*+(?:(?:\\.|"(?!""))[^"\\]*+)*+(?:"{3,5}|\\?\Z)'
    r"|'''[^']*+(?:'(?!'')[^']*+)*+(?:'{3,5}|\Z)"
    r'|"[^"\\\n]*+(?:\\.[^"\\\n]*+)*+(?:"|\\?(?=\n|\Z))'
    r"|'[^'\n]*+(?:'|(?=\n|\Z))"
    r"|\#[^\n]*+",
    re.DOTALL,
)
_DOTTED = re.compile(r"(?<![\w.-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++)++")


def read_toml(text: str, parse_float: Callable[[str], Any] = float) -> dict[str, Any]:
    """Parse the text and return its content.

    Raises:
        TOMLDecodeError: The text is not TOML.
        UnreadableDataError: Parsing would take too much work.
    """
    _check_structure(_TEXTS.sub(_make_placeholder, text))
    try:
        document = tomllib.loads(text, parse_float=parse_float)
    except TOMLDecodeError:
        raise
    except RecursionError:
        raise UnreadableDataError("it is nested too deeply") from None
    except ValueError:
        # Python rejects integers with thousands of digits.
        raise TooLongNumberError() from None
    _check_numbers(document)
    return document


def _check_numbers(value: object) -> None:
    """Raise UnreadableDataError for a number over 64 bits, TOML's limit. Python cannot print very long numbers."""
    if isinstance(value, int) and value.bit_length() > 64:
        raise TooLongNumberError()
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _check_numbers(item)


def _make_placeholder(match: re.Match[str]) -> str:
    return "" if match[0].startswith("#") else "x"


def _check_structure(structure: str) -> None:
    check_depth(structure)
    parts = 0
    for dotted_key in _DOTTED.finditer(structure):
        dots = dotted_key[0].count(".")
        if dots >= MAX_KEY_PARTS:
            raise UnreadableDataError("it has a key of more than %(most)s parts", most=MAX_KEY_PARTS)
        # One dot can be a decimal point.
        parts += dots if dots > 1 else 0
    if structure.count("=") + structure.count("[") + structure.count("{") + parts > MAX_KEYS:
        raise TooManyValuesError("it has more than %(most)s keys, tables and lists", most=MAX_KEYS)
    if structure.count(",") > MAX_VALUES:
        raise TooManyValuesError("it has more than %(most)s values", most=MAX_VALUES)
