"""JSON reader with limits on the number of values and on depth.

A list of empty lists takes thirty times its length in memory, and each nesting level uses a level of the reader's
stack.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from json import JSONDecodeError
from typing import Any

from sim.readers.reader_errors import (
    MAX_DEPTH,
    TooLongNumberError,
    TooManyValuesError,
    UnreadableDataError,
    check_depth,
)

__all__ = ["MAX_VALUES", "JSONDecodeError", "read_json"]

MAX_VALUES = 200_000
#: An unterminated string extends to the end of the text, which avoids a new search at each later quote.
_STRINGS = re.compile(r'"[^"\\]*+(?:\\.[^"\\]*+)*+(?:"|\\?\Z)', re.DOTALL)


def read_json(
    text: str | bytes,
    *,
    max_values: int = MAX_VALUES,
    parse_constant: Callable[[str], Any] | None = None,
    strict: bool = True,
) -> Any:
    """Parse the text and return its value; bytes are UTF-8, with or without a byte order mark.

    Raises:
        JSONDecodeError: The text is not JSON.
        UnreadableDataError: Parsing would take too much work.
    """
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise UnreadableDataError("it is not UTF-8") from None
    _check_limits(text, max_values)
    # With any option, json.loads builds a decoder, which takes as long as a short text.
    options: dict[str, Any] = {} if strict else {"strict": False}
    try:
        return json.loads(text, parse_constant=parse_constant, **options)
    except JSONDecodeError:
        raise
    except RecursionError:
        raise UnreadableDataError("it is nested too deeply") from None
    except ValueError as error:
        if "integer string conversion" not in str(error):
            raise
        # Python rejects integers with thousands of digits.
        raise TooLongNumberError() from None


def _check_limits(text: str, max_values: int) -> None:
    opened = text.count("[") + text.count("{")
    if opened <= MAX_DEPTH and opened + text.count(",") <= max_values:
        return
    structure = _STRINGS.sub("", text)
    if structure.count(",") + structure.count("[") + structure.count("{") > max_values:
        raise TooManyValuesError("it has more than %(most)s values", most=max_values)
    check_depth(structure)
