"""The worker's end of the wire: strict parsing of untrusted frames from a child.

Each line is one JSON object with a closed schema. No frame can carry a mark, a time or a verdict. ``packed.py`` handles
the compact packets for a robot program's frequent actions.
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
MOST = 65536


class WireError(Exception):
    """Raised for an invalid frame; the message says why."""


Check = Callable[[object], bool]

#: Largest absolute number in a frame.
LARGEST = sys.float_info.max


def _text(value: object) -> bool:
    return isinstance(value, str)


def _whole(low: int, high: int) -> Check:
    return lambda value: type(value) is int and low <= value <= high


def _flag(value: object) -> bool:
    return type(value) is bool


def _number(value: object) -> bool:
    # A very large int is finite but doesn't fit a float.
    return type(value) in (int, float) and -LARGEST <= value <= LARGEST  # type: ignore[operator]


def _packed_alone(_: object) -> bool:
    """Reject the field in JSON lines. Only packets may contain this action."""
    return False


def _one_of(*values: object) -> Check:
    return lambda value: isinstance(value, str) and value in values


def _or_none(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _error(value: object) -> bool:
    return (
        isinstance(value, dict)
        and value.keys() - {"hint"} == {"type", "text", "line", "file"}
        and isinstance(value["type"], str)
        and isinstance(value["text"], str)
        and _line(value["line"])
        and _file(value["file"])
        and isinstance(value.get("hint", ""), str)
    )


def _module_file(value: object) -> bool:
    return isinstance(value, str) and value.endswith(".py") and value[:-3].isidentifier() and len(value) <= 200


_line = _or_none(_whole(0, 10**7))
_file = _or_none(_module_file)
#: A place in the student's files: a line, and the file if it isn't the main one.
_PLACE: Mapping[str, Check] = MappingProxyType({"line": _line, "file": _file})
_port = _one_of("outB", "outC")
#: Longest time that a program can request, thirds of a microsecond.
MOST_UNITS = 10**15
_units = _whole(0, MOST_UNITS)

Schema = Mapping[str, tuple[Mapping[str, Check], Mapping[str, Check]]]

#: First frame of every child, before any student code: the active sandbox layers.
SANDBOX: Schema = MappingProxyType(
    {
        "sandbox": (
            {
                "landlock": _whole(0, 99),
                "seccomp": _flag,
                "own_user": _flag,
                "fixed_addresses": _flag,
                "without_doorkeeper": _or_none(_text),
                "policy": _text,
                "missing": _or_none(_text),
            },
            {},
        )
    }
)

#: Frames of a child that runs the short battery of sandbox tests instead of student code.
BATTERY: Schema = MappingProxyType(
    {
        "battery": (
            {"version": _text, "tried": _whole(0, 10_000), "through": lambda value: isinstance(value, list)},
            {},
        )
    }
)

_REFUSED: tuple[Mapping[str, Check], Mapping[str, Check]] = ({"what": _text, **_PLACE}, {})
#: First execution of a student's statement.
_RAN: tuple[Mapping[str, Check], Mapping[str, Check]] = (
    {"line": _whole(0, 10**7), "file": _file, "column": _whole(0, 10**7)},
    {},
)
#: Last frame of a child without libraries that has imported one.
_LIBRARIES: tuple[Mapping[str, Check], Mapping[str, Check]] = ({}, {})

#: Frames of a robot program's process: for each ``do``, the required and the optional fields.
ROBOT: Schema = MappingProxyType(
    {
        "acts": ({"acts": _packed_alone}, {}),
        "refused": _REFUSED,
        "ran": _RAN,
        "libraries": _LIBRARIES,
        "print": ({"text": _text}, {}),
        "say": ({"text": _text}, {}),
        "polarity": ({"port": _port, "polarity": _text}, {}),
        "motor_state": ({"port": _port}, {}),
        "paid_motor": ({"port": _port}, {}),
        "until": (
            {"port": _port, "state": _one_of("running", "still"), "timeout": _or_none(_units)},
            {},
        ),
        "until_said": ({}, {}),
        "stuck": (_PLACE, {}),
        "busy": (_PLACE, {}),
        "end": ({"error": _or_none(_error)}, {}),
    }
)

#: Frames of a responder's process.
RESPONDER: Schema = MappingProxyType(
    {
        "refused": _REFUSED,
        "ran": _RAN,
        "libraries": _LIBRARIES,
        "ready": ({"error": _or_none(_error)}, {}),
        "print": ({"text": _text}, {}),
        "sleep": ({"units": _units}, {}),
        "busy": (_PLACE, {}),
        "call": (
            {
                "depth": _whole(0, 1000),
                "caller": _text,
                "callee": _text,
                "argument": _text,
                "result": _text,
            },
            {},
        ),
        "answer": (
            {"kind": _one_of("text", "error", "other", "long")},
            {"text": _text, "error": _error, "type": _text, "length": _whole(0, 10**12)},
        ),
    }
)

#: Frames of a notebook's process.
NOTEBOOK: Schema = MappingProxyType(
    {
        **RESPONDER,
        "cell": ({"place": _whole(0, 10**5), "answers": _flag}, {}),
        "raised": ({"error": _error}, {}),
        "note": ({"text": _text, **_PLACE}, {}),
        "magic": (
            {
                "name": _one_of("sim_magic", "sim_magic_imports", "sim_magic_preloaded"),
                "arguments": _text,
                "body": _or_none(_text),
                "line": _line,
                "missing": _or_none(_text),
            },
            {},
        ),
        "state": ({}, {}),
        "executed": ({"missing": _or_none(_text)}, {}),
    }
)

#: Frames of a process for function calls.
CALLS: Schema = MappingProxyType(
    {
        **RESPONDER,
        "returned": (
            {"kind": _one_of("value", "missing", "error", "other", "long")},
            {"text": _text, "error": _error, "type": _text, "length": _whole(0, 10**12)},
        ),
    }
)

_ASK: tuple[Mapping[str, Check], Mapping[str, Check]] = ({"agent": _text, "arguments": _text, "named": _text}, {})

#: Frames of a responder's process with agents, of a notebook's with agents, and of an agent's.
RESPONDER_WITH_AGENTS: Schema = MappingProxyType({**RESPONDER, "ask": _ASK})
NOTEBOOK_WITH_AGENTS: Schema = MappingProxyType({**NOTEBOOK, "ask": _ASK})
AGENT: Schema = MappingProxyType({**CALLS, "ask": _ASK})

#: Frames that are not charged to the meter. They hold only numbers and schema words, or are a child's last frame, so
#: nothing of their text is stored. Honest programs send thousands of them.
NOTHING_KEPT = frozenset(
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
_ANSWER = {"text": "text", "error": "error", "other": "type", "long": "length"}


def _no_constant(name: str) -> None:
    raise WireError(f"{name} is not a JSON number")


def _no_duplicates(pairs: list[tuple[str, Any]]) -> Frame:
    frame = dict(pairs)
    if len(frame) != len(pairs):
        raise WireError("a key appears twice")
    return frame


_decode = json.JSONDecoder(parse_constant=_no_constant, object_pairs_hook=_no_duplicates).decode


_SURROGATE = re.compile(rb"\\u[dD][89a-fA-F]")
#: Start of every line. It can't occur elsewhere in the line, because inner quotation marks are escaped.
BEGINNING = b'{"n":'
_NUMBER = re.compile(re.escape(BEGINNING) + rb"(0|[1-9][0-9]{0,11}),")


def unnumbered(line: bytes) -> tuple[int, bytes]:
    """Return the frame number and the rest of a line.

    Frames are numbered from 0 in each direction, so lost, repeated or inserted frames are detected.

    Raises:
        WireError: If the line has no valid number.
    """
    number = _NUMBER.match(line)
    if number is None:
        raise WireError("a frame without its number")
    return int(number[1]), b"{" + line[number.end() :]


def parse(line: bytes, schema: Schema) -> Frame:
    """Return a validated frame of ``schema`` from a line without its number.

    Raises:
        WireError: If the line is invalid.
    """
    if len(line) > MOST:
        raise WireError(f"a frame of more than {MOST} bytes")
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
    required, optional = fields
    for name, check in required.items():
        if name not in frame or not check(frame[name]):
            raise WireError(f"a {frame['do']} frame with a wrong {name}")
    if len(frame) > len(required) + 1:
        for name, value in frame.items():
            if name == "do" or name in required:
                continue
            if name not in optional or not optional[name](value):
                raise WireError(f"a {frame['do']} frame with a wrong {name[:40]!r}")
    if frame["do"] == "answer" and _ANSWER[frame["kind"]] not in frame:
        raise WireError(f"an answer without its {_ANSWER[frame['kind']]}")
    return _encodable(frame) if _SURROGATE.search(line) else frame


def _encodable(value: Any) -> Any:
    """Return the value with lone surrogates replaced, which files and databases reject."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, dict):
        return {name: _encodable(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_encodable(each) for each in value]
    return value


_encode = json.JSONEncoder(separators=(",", ":")).encode


def encode(frame: Mapping[str, Any], number: int, arrived: Sequence[str] = ()) -> bytes:
    """Return a frame for a child as one line with its number.

    ``arrived`` holds JSON texts, which are inserted into the list ``m`` unchanged.
    """
    line = _encode({"n": number, **frame}).encode("ascii")
    if arrived:
        # Keeps lone surrogates: the child's JSON parser accepts them.
        line = line[:-1] + f',"m":[{",".join(arrived)}]}}'.encode("utf-8", "surrogatepass")
    return line + b"\n"
