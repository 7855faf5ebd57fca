"""The formats of the texts that cross the bridge: which printed lines are messages, image data, JSON answers.

All functions are pure. ``channel.py`` computes arrivals.
"""

from __future__ import annotations

import json
from typing import Any, Literal

from sim.readers.json_text import JSONDecodeError, read_json
from sim.recording import DatalogEntry

PY = "PY::"
IMG_DATA = "IMG_DATA"
_MAX_NUMBER = 1e15
JSON = "JSON::"

_DATALOG_PREFIXES = (
    "^log",
    "Ultrasonic:",
    "Colour:",
    "Light_left:",
    "Light_right:",
    "Gyro:",
    "Wheel_left:",
    "Wheel_right:",
)


def classify_text(text: str) -> Literal["py", "image", "log image", "text"]:
    """Return the kind of a printed text. Prefixes count only at the start."""
    if text.startswith(PY):
        return "py"
    if text.startswith(IMG_DATA):
        return "image"
    if text.startswith("image_data"):
        return "log image"
    return "text"


def format_csv(rgba: bytes) -> str:
    """Return image bytes in the simulator's format: decimal numbers separated by commas."""
    return ",".join(map(str, rgba))


def format_image_message(left: bytes, right: bytes) -> str:
    """Return the ``IMG_DATA::`` message with the RGBA numbers of both sensors as comma-separated strings."""
    return f'{IMG_DATA}::{{"left":"{format_csv(left)}","right":"{format_csv(right)}"}}'


def parse_logged_sides(text: str) -> tuple[Literal["left", "right"], ...]:
    """Return the sensors that ``image_data left|right|both`` logs."""
    words = text.split(" ")
    side = words[1] if len(words) > 1 else ""
    if side == "both":
        return ("left", "right")
    return (side,) if side in ("left", "right") else ()  # type: ignore[return-value]


def parse_datum(text: str, t: float) -> DatalogEntry | None:
    """Return the datalog entry in a printed line, or None if the line has none or its numbers are impossible."""
    if not text.startswith(_DATALOG_PREFIXES):
        return None
    name, colon, rest = text.partition(": ")
    words = rest.split()
    if not colon or not words:
        return None
    try:
        numbers = [float(word) for word in words[:2]]
    except ValueError:
        return None
    # Rejects NaN, infinity, and numbers whose sum could overflow.
    if not all(abs(number) <= _MAX_NUMBER for number in numbers):
        return None
    return DatalogEntry(t, name, numbers[0], numbers[1] if len(numbers) > 1 else None)


def _reject_constant(name: str) -> None:
    raise ValueError(f"{name} is not allowed in JSON")


def _convert_whole_floats(value: Any) -> Any:
    """Return the value with whole floats as ints, as JavaScript does."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return int(value)
    if isinstance(value, list):
        return [_convert_whole_floats(item) for item in value]
    if isinstance(value, dict):
        return {key: _convert_whole_floats(item) for key, item in value.items()}
    return value


def parse_answer(text: str) -> Any:
    """Return the object in an answer that starts with ``JSON::``.

    Raises:
        ValueError: If the JSON is malformed, with the reason.
    """
    try:
        return _convert_whole_floats(read_json(text[len(JSON) :], parse_constant=_reject_constant))
    except JSONDecodeError as error:
        raise ValueError(f"{error.msg} at character {error.pos + 1}") from None


def format_queue_entry(text: str) -> str:
    """Return the object of a ``JSON::`` answer as compact JSON for the robot's queue.

    Raises:
        ValueError: If the JSON is malformed, with the reason.
    """
    return json.dumps(parse_answer(text), separators=(",", ":"), ensure_ascii=False)


def format_partner_entry(text: str) -> str:
    """Return the entry that a robot's text adds to the queue of the other robot, as JSON.

    It is the object after ``PY::JSON::`` or ``IMG_DATA::``, otherwise the text after ``PY::``.

    Raises:
        ValueError: If the JSON is malformed, with the reason.
    """
    if text.startswith(IMG_DATA):
        return text.removeprefix(f"{IMG_DATA}::")
    content = text.removeprefix(PY)
    return format_queue_entry(content) if content.startswith(JSON) else json.dumps(content)
