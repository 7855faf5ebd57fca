"""The texts that cross the bridge: which print is a message, what IMG_DATA carries, what an answer means.

Pure functions over text; when and whether a text arrives is ``channel.py``'s business.
"""

from __future__ import annotations

import json
from typing import Any, Literal

from sim.readers.json_text import JSONDecodeError, read_json
from sim.recording import Datum

PY = "PY::"
IMG_DATA = "IMG_DATA"
_MOST = 1e15
JSON = "JSON::"

_DATALOG = (
    "^log",
    "Ultrasonic:",
    "Colour:",
    "Light_left:",
    "Light_right:",
    "Gyro:",
    "Wheel_left:",
    "Wheel_right:",
)


def kind(text: str) -> Literal["py", "image", "log image", "text"]:
    """What a printed text is; prefixes count only at its very start."""
    if text.startswith(PY):
        return "py"
    if text.startswith(IMG_DATA):
        return "image"
    if text.startswith("image_data"):
        return "log image"
    return "text"


def csv(rgba: bytes) -> str:
    """Bytes of an image as the simulator writes them: decimal numbers, commas, nothing else."""
    return ",".join(map(str, rgba))


def image_message(left: bytes, right: bytes) -> str:
    """``IMG_DATA::`` and both sensors' RGBA numbers as comma strings."""
    return f'{IMG_DATA}::{{"left":"{csv(left)}","right":"{csv(right)}"}}'


def logged_sides(text: str) -> tuple[Literal["left", "right"], ...]:
    """Which sensors ``image_data left|right|both`` logs."""
    words = text.split(" ")
    which = words[1] if len(words) > 1 else ""
    if which == "both":
        return ("left", "right")
    return (which,) if which in ("left", "right") else ()  # type: ignore[return-value]


def datum(text: str, t: float) -> Datum | None:
    """The datalog entry in a printed line, None if it is not one or has no numbers that a sensor could have given."""
    if not text.startswith(_DATALOG):
        return None
    name, colon, rest = text.partition(": ")
    words = rest.split()
    if not colon or not words:
        return None
    try:
        numbers = [float(word) for word in words[:2]]
    except ValueError:
        return None
    # Not what is infinite or no number, nor what becomes so when a few are added up.
    if not all(abs(number) <= _MOST for number in numbers):
        return None
    return Datum(t, name, numbers[0], numbers[1] if len(numbers) > 1 else None)


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not allowed in JSON")


def _plain(value: Any) -> Any:
    """Whole floats become ints, as they do on their way through JavaScript."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return int(value)
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value


def parsed_answer(text: str) -> Any:
    """The object in an answer that starts with ``JSON::``. Raises ValueError with the reason if it is malformed."""
    try:
        return _plain(read_json(text[len(JSON) :], parse_constant=_no_constant))
    except JSONDecodeError as error:
        raise ValueError(f"{error.msg} at character {error.pos + 1}") from None


def queue_entry(text: str) -> str:
    """The same object as JSON for the robot's queue, as short as the answer. Raises ValueError as ``parsed_answer``."""
    return json.dumps(parsed_answer(text), separators=(",", ":"), ensure_ascii=False)


def passed_on(text: str) -> str:
    """What a robot's text adds to the queue of the other robot, as JSON.

    It is the object after ``PY::JSON::`` or ``IMG_DATA::``, else the text after ``PY::``. Raises ValueError as
    ``parsed_answer``.
    """
    if text.startswith(IMG_DATA):
        return text.removeprefix(f"{IMG_DATA}::")
    said = text.removeprefix(PY)
    return queue_entry(said) if said.startswith(JSON) else json.dumps(said)
