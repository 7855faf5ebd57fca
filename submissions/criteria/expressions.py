"""Instructors' regular expressions on RE2, which matches any pattern in time proportional to the text.

The expressions have the syntax and meaning of Python's ``re``.
"""

from __future__ import annotations

import functools
import re
from typing import Any

import re2

#: Unicode equivalents of Python's classes; RE2's own classes cover only ASCII.
_WORD, _SPACE = r"\p{L}\p{N}_", r"\s\v\x1c-\x1f\x{85}\p{Z}"
_INSIDE = {r"\d": r"\p{Nd}", r"\D": r"\P{Nd}", r"\w": _WORD, r"\s": _SPACE}
_OUTSIDE = _INSIDE | {
    r"\w": f"[{_WORD}]",
    r"\W": f"[^{_WORD}]",
    r"\s": f"[{_SPACE}]",
    r"\S": f"[^{_SPACE}]",
    r"\Z": r"\z",
    "{,": "{0,",
}
#: An escape, a class in brackets, or a repetition without a minimum. A class without an end extends to the end of the
#: pattern, which avoids a new search at each later bracket.
_PART = re.compile(r"\\.|\[\^?+\]?+(?:\\.|[^\]\\])*+(?:\]|\\?\Z)|\{,(?=\d++\})", re.DOTALL)
_ESCAPE = re.compile(r"\\.", re.DOTALL)
#: Instructions of a compiled pattern, which takes 40 ms of CPU with so many. ``\w`` has 1,347; the catalogue's largest
#: pattern has 51,855.
_MAX_INSTRUCTIONS = 60_000


def check_pattern(pattern: str) -> str:
    """Return the pattern unchanged if it can be used.

    Raises:
        ValueError: The pattern cannot be used. The message has the problem and the expected form.
    """
    _compile_pattern(pattern, False)
    return pattern


def has_match(text: str, pattern: str, ignore_case: bool) -> bool:
    """Return whether the pattern matches anywhere in the text. ``$`` matches the end, or before a final line feed."""
    compiled, data = _compile_pattern(pattern, ignore_case), text.encode("utf-8", "replace")
    shortened_data = data if _has_end_escape(pattern) else data.removesuffix(b"\n")
    return any(compiled.search(each) is not None for each in {data, shortened_data})


@functools.lru_cache(maxsize=64)
def _has_end_escape(pattern: str) -> bool:
    r"""Whether the pattern has \Z, which matches after a final line feed only."""
    return r"\Z" in _PART.findall(pattern)


@functools.lru_cache(maxsize=64)
def _compile_pattern(pattern: str, ignore_case: bool) -> Any:
    options = re2.Options()
    options.case_sensitive = not ignore_case
    options.never_capture = True
    options.log_errors = False
    try:
        compiled = re2.compile(_PART.sub(lambda part: _translate_part(part[0]), pattern), options)
    except (re2.error, ValueError) as error:
        reason = error.args[0].decode("utf-8", "replace") if isinstance(error, re2.error) else str(error)
        raise ValueError(
            f"is not a regular expression that can be used ({reason}), expected one without look-around, "
            "back-references, possessive repetition and atomic groups"
        ) from None
    if compiled.programsize > _MAX_INSTRUCTIONS:
        raise ValueError(
            "is a regular expression that repeats too much, expected fewer or smaller repetitions, such as + in place "
            "of {300}"
        )
    return compiled


def _translate_part(part: str) -> str:
    if not part.startswith("["):
        return _OUTSIDE.get(part, part)
    negated_escape = next((each for each in _ESCAPE.findall(part) if each in (r"\W", r"\S")), None)
    if negated_escape is not None:
        raise ValueError(f"{negated_escape} in brackets")
    return _ESCAPE.sub(lambda escape: _INSIDE.get(escape[0], escape[0]), part)
