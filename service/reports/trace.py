"""A recording as plain numbers and strings, for ``robomark run --trace`` and for calculations.

It contains everything except the inner steps of the hash chain, and only numbers that JSON allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from sim.recorded import seconds_at
from sim.recording import Image, Line, Pose, Recording


def trace(recording: Recording) -> dict[str, Any]:
    """Return ``recording`` as a JSON-serialisable dict: one row per tick under ``ticks``, then texts and messages.

    Times are seconds, lengths mm, headings degrees anticlockwise and unwrapped, light 0..255, gyro degrees clockwise,
    encoders degrees. A value that is not finite becomes None. Light images are flat RGBA lists. With two robots, this
    is the first; the second is its ``partner``.
    """
    return {
        "ticks": {name: _numbers(column.tolist()) for name, column in recording.ticks.told().items()},
        "printed": _lines(recording.printed),
        "spoken": _lines(recording.spoken),
        "messages": [
            {
                "t": _finite(message.t),
                "sender": message.sender,
                "text": storable(message.text),
                "delivered": None if message.delivered is None else _finite(message.delivered),
                "reply_to": message.reply_to,
                "note": message.note,
                "lost": message.lost,
                "distance": message.distance,
                "angle": message.angle,
                "arrived_as": None if message.arrived_as is None else storable(message.arrived_as),
            }
            for message in recording.messages
        ],
        **agent_messages(recording),
        "datalog": [
            {
                "t": _finite(datum.t),
                "name": storable(datum.name),
                "value": _finite(datum.value),
                "simtime": None if datum.simtime is None else _finite(datum.simtime),
            }
            for datum in recording.datalog
        ],
        "images": _images(recording),
        "verdict": recording.verdict.value,
        "start": {"t": 0.0, **_pose(recording.start)},
        "end": {"t": _finite(recording.end_t), **_pose(recording.end)},
        "sha256": recording.sha256,
        "sandbox": recording.sandbox,
        **({"partner": trace(recording.partner)} if recording.partner is not None else {}),
    }


def agent_messages(recording: Recording) -> dict[str, Any]:
    """Return the messages between the responder and its agents, under their key; empty if there are none."""
    told = [
        {
            "t": _finite(each.t),
            "sender": each.sender,
            "receiver": each.receiver,
            "text": storable(each.text),
            "message": each.message,
            "reply_to": each.reply_to,
            "note": each.note,
        }
        for each in recording.agent_messages
    ]
    return {"agent_messages": told} if told else {}


def storable(text: str) -> str:
    """Return ``text`` with lone surrogates replaced, so that every JSON reader and encoding accepts it."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _images(recording: Recording) -> list[dict[str, Any]]:
    """Return images sent by ``IMG_DATA`` (both sides, with pose) and logged by ``image_data`` (one side), by tick."""
    rows = [_sent(image) for image in recording.images]
    for side, csv, tick in recording.image_log:
        rows.append(
            {
                "t": seconds_at(recording, tick),
                "tick": tick,
                "source": "image_data",
                side: [int(value) for value in csv.split(",") if value.strip().isdecimal()],
            }
        )
    return sorted(rows, key=lambda row: int(row["tick"]))


def _sent(image: Image) -> dict[str, Any]:
    return {
        "t": _finite(image.t),
        "tick": image.tick,
        "source": "IMG_DATA",
        **_pose(image.pose),
        "side": image.side,
        "left": list(image.left),
        "right": list(image.right),
        "message": image.message,
        "truth": image.truth,
    }


def _pose(pose: Pose) -> dict[str, float | None]:
    return {"x": _finite(pose.x), "y": _finite(pose.y), "heading": _finite(pose.heading)}


def _lines(lines: Iterable[Line]) -> list[list[float | str | None]]:
    return [[_finite(line.t), storable(line.text)] for line in lines]


def _numbers(values: Iterable[Any]) -> list[Any]:
    return [_numbers(value) if isinstance(value, list) else _finite(value) for value in values]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
