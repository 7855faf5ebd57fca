"""Calls a function of a loaded module by its name, and hands back what it returns as JSON.

What is called and what the value is worth is the worker's business, on the other side of the wire.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from .frames import Frame, fits
from .student_code import StudentFiles

#: In place of a responder's name: the module needs none.
NO_RESPONDER = ""


def returned(namespace: dict[str, Any], files: StudentFiles, spec: Frame) -> Frame:
    """The answer to one ``call`` spec."""
    function = namespace.get(spec["function"])
    if not callable(function):
        return {"do": "returned", "kind": "missing"}
    return value_frame(lambda: function(*spec["arguments"], **spec["named"]), files)


def value_frame(call: Callable[[], Any], files: StudentFiles) -> Frame:
    """What a call of the student's gives, or what went wrong instead."""
    try:
        value = call()
        text = as_json(value)
    except BaseException as error:
        return {"do": "returned", "kind": "error", "error": files.described(error)}
    if text is None:
        return {"do": "returned", "kind": "other", "type": type(value).__name__[:100]}
    if not fits(text):
        return {"do": "returned", "kind": "long", "length": len(text)}
    return {"do": "returned", "kind": "value", "text": text}


def as_json(value: Any) -> str | None:
    """None for what JSON does not have; arrays are lists."""
    try:
        return json.dumps(value, allow_nan=False, default=_plain)
    except (TypeError, ValueError, RecursionError):
        return None


def _plain(value: Any) -> Any:
    if isinstance(value, set | frozenset):
        return sorted(value, key=repr)
    if hasattr(value, "tolist"):  # numpy and pandas
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
