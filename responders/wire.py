"""The worker's end of the wire: strict parsing of untrusted frames from a child.

Each line is one JSON object with a closed schema. No frame can carry a mark, a time or a verdict. ``packets.py``
handles the compact packets for a robot program's frequent actions.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

Frame = dict[str, Any]

#: Maximum line length, bytes.
MAX_FRAME_BYTES = 65536


class WireError(Exception):
    """Raised for an invalid frame; the message says why."""


Check = Callable[[object], bool]

#: Largest absolute number in a frame.
MAX_NUMBER = sys.float_info.max


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _allow_range(minimum: int, maximum: int) -> Check:
    return lambda value: type(value) is int and minimum <= value <= maximum


def _is_flag(value: object) -> bool:
    return type(value) is bool


def _is_number(value: object) -> bool:
    # A very large int is finite but doesn't fit a float.
    return type(value) in (int, float) and -MAX_NUMBER <= value <= MAX_NUMBER  # type: ignore[operator]


def _reject_unpacked(_: object) -> bool:
    """Reject the field in JSON lines. Only packets may contain this action."""
    return False


def _allow_values(*values: object) -> Check:
    return lambda value: isinstance(value, str) and value in values


def _allow_none(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _is_error(value: object) -> bool:
    return (
        isinstance(value, dict)
        and value.keys() - {"hint"} == {"type", "text", "line", "file"}
        and isinstance(value["type"], str)
        and isinstance(value["text"], str)
        and _is_line(value["line"])
        and _is_file(value["file"])
        and isinstance(value.get("hint", ""), str)
    )


def _is_module_file(value: object) -> bool:
    return isinstance(value, str) and value.endswith(".py") and value[:-3].isidentifier() and len(value) <= 200


_is_line = _allow_none(_allow_range(0, 10**7))
_is_file = _allow_none(_is_module_file)
#: A place in the student's files: a line, and the file if it isn't the main one.
_PLACE: Mapping[str, Check] = MappingProxyType({"line": _is_line, "file": _is_file})
_is_port = _allow_values("outB", "outC")
#: Longest time that a program can request, thirds of a microsecond.
MAX_UNITS = 10**15
_is_duration = _allow_range(0, MAX_UNITS)

Schema = Mapping[str, tuple[Mapping[str, Check], Mapping[str, Check]]]

#: First frame of every child, before any student code: the active sandbox layers.
SANDBOX: Schema = MappingProxyType(
    {
        "sandbox": (
            {
                "landlock": _allow_range(0, 99),
                "seccomp": _is_flag,
                "own_user": _is_flag,
                "fixed_addresses": _is_flag,
                "without_doorkeeper": _allow_none(_is_text),
                "policy": _is_text,
                "missing": _allow_none(_is_text),
            },
            {},
        )
    }
)

#: Frames of a child that runs the short battery of sandbox tests instead of student code.
BATTERY: Schema = MappingProxyType(
    {
        "battery": (
            {"version": _is_text, "tried": _allow_range(0, 10_000), "through": lambda value: isinstance(value, list)},
            {},
        )
    }
)

_REFUSED: tuple[Mapping[str, Check], Mapping[str, Check]] = ({"what": _is_text, **_PLACE}, {})
#: First execution of a student's statement.
_RAN: tuple[Mapping[str, Check], Mapping[str, Check]] = (
    {"line": _allow_range(0, 10**7), "file": _is_file, "column": _allow_range(0, 10**7)},
    {},
)
#: Last frame of a child without libraries that has imported one.
_LIBRARIES: tuple[Mapping[str, Check], Mapping[str, Check]] = ({}, {})

#: Frames of a robot program's process: for each ``do``, the required and the optional fields.
ROBOT: Schema = MappingProxyType(
    {
        "acts": ({"acts": _reject_unpacked}, {}),
        "refused": _REFUSED,
        "ran": _RAN,
        "libraries": _LIBRARIES,
        "print": ({"text": _is_text}, {}),
        "say": ({"text": _is_text}, {}),
        "polarity": ({"port": _is_port, "polarity": _is_text}, {}),
        "motor_state": ({"port": _is_port}, {}),
        "paid_motor": ({"port": _is_port}, {}),
        "until": (
            {"port": _is_port, "state": _allow_values("running", "still"), "timeout": _allow_none(_is_duration)},
            {},
        ),
        "until_said": ({}, {}),
        "stuck": (_PLACE, {}),
        "busy": (_PLACE, {}),
        "end": ({"error": _allow_none(_is_error)}, {}),
    }
)

#: Frames of a responder's process.
RESPONDER: Schema = MappingProxyType(
    {
        "refused": _REFUSED,
        "ran": _RAN,
        "libraries": _LIBRARIES,
        "ready": ({"error": _allow_none(_is_error)}, {}),
        "print": ({"text": _is_text}, {}),
        "sleep": ({"units": _is_duration}, {}),
        "busy": (_PLACE, {}),
        "call": (
            {
                "depth": _allow_range(0, 1000),
                "caller": _is_text,
                "callee": _is_text,
                "argument": _is_text,
                "result": _is_text,
            },
            {},
        ),
        "answer": (
            {"kind": _allow_values("text", "error", "other", "long")},
            {"text": _is_text, "error": _is_error, "type": _is_text, "length": _allow_range(0, 10**12)},
        ),
    }
)

#: Frames of a notebook's process.
NOTEBOOK: Schema = MappingProxyType(
    {
        **RESPONDER,
        "cell": ({"place": _allow_range(0, 10**5), "answers": _is_flag}, {}),
        "raised": ({"error": _is_error}, {}),
        "note": ({"text": _is_text, **_PLACE}, {}),
        "magic": (
            {
                "name": _allow_values("sim_magic", "sim_magic_imports", "sim_magic_preloaded"),
                "arguments": _is_text,
                "body": _allow_none(_is_text),
                "line": _is_line,
                "missing": _allow_none(_is_text),
            },
            {},
        ),
        "state": ({}, {}),
        "executed": ({"missing": _allow_none(_is_text)}, {}),
    }
)

#: Frames of a process for function calls.
CALLS: Schema = MappingProxyType(
    {
        **RESPONDER,
        "returned": (
            {"kind": _allow_values("value", "missing", "error", "other", "long")},
            {"text": _is_text, "error": _is_error, "type": _is_text, "length": _allow_range(0, 10**12)},
        ),
    }
)

_ASK: tuple[Mapping[str, Check], Mapping[str, Check]] = (
    {"agent": _is_text, "arguments": _is_text, "named": _is_text},
    {},
)

#: Frames of a responder's process with agents, of a notebook's with agents, and of an agent's.
RESPONDER_WITH_AGENTS: Schema = MappingProxyType({**RESPONDER, "ask": _ASK})
NOTEBOOK_WITH_AGENTS: Schema = MappingProxyType({**NOTEBOOK, "ask": _ASK})
AGENT: Schema = MappingProxyType({**CALLS, "ask": _ASK})

#: Frames that are not charged to the meter. They hold only numbers and schema words, or are a child's last frame, so
#: nothing of their text is stored. Honest programs send thousands of them.
UNCHARGED_FRAMES = frozenset(
    {
        "polarity",
        "motor_state",
        "paid_motor",
        "until",
        "until_said",
        "stuck",
        "busy",
        "libraries",
        "sleep",
        "cell",
        "state",
    }
)

#: The required field of each kind of answer.
_ANSWER_FIELDS = {"text": "text", "error": "error", "other": "type", "long": "length"}


def _reject_constant(name: str) -> None:
    raise WireError(f"{name} is not a JSON number")


def _reject_duplicates(pairs: list[tuple[str, Any]]) -> Frame:
    frame = dict(pairs)
    if len(frame) != len(pairs):
        raise WireError("a key appears twice")
    return frame


_decode = json.JSONDecoder(parse_constant=_reject_constant, object_pairs_hook=_reject_duplicates).decode


_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")
#: Start of every line. It can't occur elsewhere in the line, because inner quotation marks are escaped.
LINE_START = b'{"n":'
_NUMBER = re.compile(re.escape(LINE_START) + rb"(0|[1-9][0-9]{0,11}),")


def split_number(line: bytes) -> tuple[int, bytes]:
    """Return the frame number and the rest of a line.

    Frames are numbered from 0 in each direction, so lost, repeated or inserted frames are detected.

    Raises:
        WireError: If the line has no valid number.
    """
    number = _NUMBER.match(line)
    if number is None:
        raise WireError("a frame without its number")
    return int(number[1]), b"{" + line[number.end() :]


def parse_frame(line: bytes, schema: Schema) -> Frame:
    """Return a validated frame of ``schema`` from a line without its number.

    Raises:
        WireError: If the line is invalid.
    """
    if len(line) > MAX_FRAME_BYTES:
        raise WireError(f"a frame of more than {MAX_FRAME_BYTES} bytes")
    try:
        frame = _decode(line.decode("utf-8"))
    except WireError:
        raise
    except (ValueError, RecursionError):
        raise WireError("a frame that is not JSON") from None
    if not isinstance(frame, dict) or not isinstance(frame.get("do"), str):
        raise WireError("a frame that is not an object with a do")
    fields = schema.get(frame["do"])
    if fields is None:
        raise WireError("a frame of an unknown kind")
    required_fields, optional_fields = fields
    for name, check in required_fields.items():
        if name not in frame or not check(frame[name]):
            raise WireError(f"a {frame['do']} frame with a wrong {name}")
    if len(frame) > len(required_fields) + 1:
        for name, value in frame.items():
            if name == "do" or name in required_fields:
                continue
            if name not in optional_fields or not optional_fields[name](value):
                raise WireError(f"a {frame['do']} frame with a wrong {name[:40]!r}")
    if frame["do"] == "answer" and _ANSWER_FIELDS[frame["kind"]] not in frame:
        raise WireError(f"an answer without its {_ANSWER_FIELDS[frame['kind']]}")
    return _replace_surrogates(frame) if _SURROGATE.search(line) else frame


def _replace_surrogates(value: Any) -> Any:
    """Return the value with lone surrogates replaced, which files and databases reject."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, dict):
        return {name: _replace_surrogates(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_replace_surrogates(each) for each in value]
    return value


_encode = json.JSONEncoder(separators=(",", ":")).encode


def encode_frame(frame: Mapping[str, Any], number: int, entries: Sequence[str] = ()) -> bytes:
    """Return a frame for a child as one line with its number.

    ``entries`` holds JSON texts, which are inserted into the list ``m`` unchanged.
    """
    line = _encode({"n": number, **frame}).encode("ascii")
    if entries:
        # Keeps lone surrogates: the child's JSON parser accepts them.
        line = line[:-1] + f',"m":[{",".join(entries)}]}}'.encode("utf-8", "surrogatepass")
    return line + b"\n"
