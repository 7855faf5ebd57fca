"""A recording as plain numbers and strings, for ``robomark run --trace`` and for calculations.

It contains everything except the inner steps of the hash chain, and only numbers that JSON allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from sim.recording import Image, Pose, Recording, TimedText
from sim.recording_values import tick_to_seconds


def build_trace(recording: Recording) -> dict[str, Any]:
    """Return ``recording`` as a JSON-serialisable dict: one row per tick under ``ticks``, then texts and messages.

    Times are seconds, lengths mm, headings degrees anticlockwise and unwrapped, light 0..255, gyro degrees clockwise,
    encoders degrees. A value that is not finite becomes None. Light images are flat RGBA lists. With two robots, this
    is the first; the second is its ``partner``.
    """
    return {
        "ticks": {
            name: _replace_non_finite(column.tolist())
            for name, column in recording.ticks.to_displayed_columns().items()
        },
        "printed": _lines_to_json(recording.printed),
        "spoken": _lines_to_json(recording.spoken),
        "messages": [
            {
                "t": _to_finite(message.t),
                "sender": message.sender,
                "text": replace_surrogates(message.text),
                "delivered": None if message.delivered is None else _to_finite(message.delivered),
                "reply_to": message.reply_to,
                "note": message.note,
                "lost": message.lost,
                "distance": message.distance,
                "angle": message.angle,
                "arrived_as": None if message.arrived_as is None else replace_surrogates(message.arrived_as),
            }
            for message in recording.messages
        ],
        **agent_messages_to_json(recording),
        "datalog": [
            {
                "t": _to_finite(datum.t),
                "name": replace_surrogates(datum.name),
                "value": _to_finite(datum.value),
                "simtime": None if datum.simtime is None else _to_finite(datum.simtime),
            }
            for datum in recording.datalog
        ],
        "images": _images_to_json(recording),
        "verdict": recording.verdict.value,
        "start": {"t": 0.0, **_pose_to_json(recording.start)},
        "end": {"t": _to_finite(recording.end_t), **_pose_to_json(recording.end)},
        "sha256": recording.sha256,
        "sandbox": recording.sandbox,
        **({"partner": build_trace(recording.partner)} if recording.partner is not None else {}),
    }


def agent_messages_to_json(recording: Recording) -> dict[str, Any]:
    """Return the messages between the responder and its agents, under their key; empty if there are none."""
    messages = [
        {
            "t": _to_finite(each.t),
            "sender": each.sender,
            "receiver": each.receiver,
            "text": replace_surrogates(each.text),
            "message": each.message,
            "reply_to": each.reply_to,
            "note": each.note,
        }
        for each in recording.agent_messages
    ]
    return {"agent_messages": messages} if messages else {}


def replace_surrogates(text: str) -> str:
    """Return ``text`` with lone surrogates replaced, so that every JSON reader and encoding accepts it."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _images_to_json(recording: Recording) -> list[dict[str, Any]]:
    """Return images sent by ``IMG_DATA`` (both sides, with pose) and logged by ``image_data`` (one side), by tick."""
    rows = [_image_to_json(image) for image in recording.images]
    for side, csv, tick in recording.image_log:
        rows.append(
            {
                "t": tick_to_seconds(recording, tick),
                "tick": tick,
                "source": "image_data",
                side: [int(value) for value in csv.split(",") if value.strip().isdecimal()],
            }
        )
    return sorted(rows, key=lambda row: int(row["tick"]))


def _image_to_json(image: Image) -> dict[str, Any]:
    return {
        "t": _to_finite(image.t),
        "tick": image.tick,
        "source": "IMG_DATA",
        **_pose_to_json(image.pose),
        "side": image.side,
        "left": list(image.left),
        "right": list(image.right),
        "message": image.message,
        "truth": image.truth,
    }


def _pose_to_json(pose: Pose) -> dict[str, float | None]:
    return {"x": _to_finite(pose.x), "y": _to_finite(pose.y), "heading": _to_finite(pose.heading)}


def _lines_to_json(lines: Iterable[TimedText]) -> list[list[float | str | None]]:
    return [[_to_finite(line.t), replace_surrogates(line.text)] for line in lines]


def _replace_non_finite(values: Iterable[Any]) -> list[Any]:
    return [_replace_non_finite(value) if isinstance(value, list) else _to_finite(value) for value in values]


def _to_finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
