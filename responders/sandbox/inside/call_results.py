"""Calls functions of a loaded module by name and returns the results as JSON.

The worker chooses the calls and judges the results.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from .frames import Frame, can_send_text
from .student_code import StudentFiles

#: In place of a responder's name: the module needs no responder.
NO_RESPONDER = ""


def call_function(namespace: dict[str, Any], files: StudentFiles, spec: Frame) -> Frame:
    """Return the reply to one ``call`` spec."""
    function = namespace.get(spec["function"])
    if not callable(function):
        return {"do": "returned", "kind": "missing"}
    return build_result_frame(lambda: function(*spec["arguments"], **spec["named"]), files)


def build_result_frame(call: Callable[[], Any], files: StudentFiles) -> Frame:
    """Return the frame with the result of a call into student code, or with its error."""
    try:
        value = call()
        text = as_json(value)
    except BaseException as error:
        return {"do": "returned", "kind": "error", "error": files.describe_error(error)}
    if text is None:
        return {"do": "returned", "kind": "other", "type": type(value).__name__[:100]}
    if not can_send_text(text):
        return {"do": "returned", "kind": "long", "length": len(text)}
    return {"do": "returned", "kind": "value", "text": text}


def as_json(value: Any) -> str | None:
    """Return the value as JSON, with arrays as lists, or None if JSON can't represent it."""
    try:
        return json.dumps(value, allow_nan=False, default=_to_plain_value)
    except (TypeError, ValueError, RecursionError):
        return None


def _to_plain_value(value: Any) -> Any:
    if isinstance(value, set | frozenset):
        return sorted(value, key=repr)
    if hasattr(value, "tolist"):  # numpy and pandas
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
