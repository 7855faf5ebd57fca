"""The worker's end of the wire: frames from a child are read as if they came from the internet.

One strict JSON object a line, of a closed schema; there is no frame that could carry a mark, a time or a verdict.
What robot programs do by the thousand comes packed, which is ``packed.py``'s.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

Frame = dict[str, Any]

#: The longest line that is read, bytes.
MOST = 65536


class WireError(Exception):
    """A frame that no honest child sends; the text says what is wrong with it."""


Check = Callable[[object], bool]

#: The largest number that a frame can hold, either way.
LARGEST = sys.float_info.max


def _text(value: object) -> bool:
    return isinstance(value, str)


def _whole(low: int, high: int) -> Check:
    return lambda value: type(value) is int and low <= value <= high


def _flag(value: object) -> bool:
    return type(value) is bool


def _number(value: object) -> bool:
    # A whole number of hundreds of digits is finite and no float.
    return type(value) in (int, float) and -LARGEST <= value <= LARGEST  # type: ignore[operator]


def _packed_alone(_: object) -> bool:
    """No line can say it."""
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
#: Where in the student's files: a line, and the file if it is not the one that is run.
_PLACE: Mapping[str, Check] = MappingProxyType({"line": _line, "file": _file})
_port = _one_of("outB", "outC")
#: The longest time that a program can ask for, thirds of a microsecond.
MOST_UNITS = 10**15
_units = _whole(0, MOST_UNITS)

Schema = Mapping[str, tuple[Mapping[str, Check], Mapping[str, Check]]]

#: The first frame of every child, before any student code: which layers stand round it.
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

#: What a child says that tried the short battery instead of running student code.
BATTERY: Schema = MappingProxyType(
    {
        "battery": (
            {"version": _text, "tried": _whole(0, 10_000), "through": lambda value: isinstance(value, list)},
            {},
        )
    }
)

_REFUSED: tuple[Mapping[str, Check], Mapping[str, Check]] = ({"what": _text, **_PLACE}, {})
#: A statement of the student's that was run for the first time.
_RAN: tuple[Mapping[str, Check], Mapping[str, Check]] = (
    {"line": _whole(0, 10**7), "file": _file, "column": _whole(0, 10**7)},
    {},
)
#: The last word of a child without libraries that has imported one.
_LIBRARIES: tuple[Mapping[str, Check], Mapping[str, Check]] = ({}, {})

#: What a robot program's process may say: for each ``do``, the fields it must and those it may have.
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

#: What a responder's process may say.
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

#: What the process of a notebook may say.
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

#: What a process may say whose functions are called.
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

#: What a responder's process may say whose submission has agents, and what such an agent's process may.
RESPONDER_WITH_AGENTS: Schema = MappingProxyType({**RESPONDER, "ask": _ASK})
NOTEBOOK_WITH_AGENTS: Schema = MappingProxyType({**NOTEBOOK, "ask": _ASK})
AGENT: Schema = MappingProxyType({**CALLS, "ask": _ASK})

#: Kinds that hold numbers and words of the schema alone, or are a child's last. Nothing else that a child has worded is
#: kept of them, and honest programs send thousands; every other frame is paid for before it is handed on.
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

#: The field that each kind of answer must have.
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
#: What every line begins with, and nothing else in it can hold: a quotation mark inside of it is escaped.
BEGINNING = b'{"n":'
_NUMBER = re.compile(re.escape(BEGINNING) + rb"(0|[1-9][0-9]{0,11}),")


def unnumbered(line: bytes) -> tuple[int, bytes]:
    """The number that every line begins with, and the frame without it. Raises WireError.

    Frames are counted from 0 in each direction: one that was lost, repeated or slipped in shows.
    """
    number = _NUMBER.match(line)
    if number is None:
        raise WireError("a frame without its number")
    return int(number[1]), b"{" + line[number.end() :]


def parse(line: bytes, schema: Schema) -> Frame:
    """One frame of ``schema``, without its number. Raises WireError for anything else."""
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
    """The same without halves of characters, which no file and no database takes."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, dict):
        return {name: _encodable(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_encodable(each) for each in value]
    return value


_encode = json.JSONEncoder(separators=(",", ":")).encode


def encode(frame: Mapping[str, Any], number: int, arrived: Sequence[str] = ()) -> bytes:
    """A frame for a child, as one line that begins with its number.

    What has ``arrived`` is JSON already, and goes into the list ``m`` as it is.
    """
    line = _encode({"n": number, **frame}).encode("ascii")
    if arrived:
        # Halves of characters too: the child's JSON takes them.
        line = line[:-1] + f',"m":[{",".join(arrived)}]}}'.encode("utf-8", "surrogatepass")
    return line + b"\n"
