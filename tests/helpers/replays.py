"""Replays for tests: their data as the page reads it, long recordings, and copies with hostile texts."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from report_builders import line_follower_grade, line_follower_recording
from service.grading.grade import Grade, TrialResult
from sim.recording import COLUMNS, Image, Pose, Recording, Ticks, TimedText

#: Texts in a replay's data and in a grade that do not come from students.
_NO_TEXTS = {
    "format", "image", "left", "right", "unit", "background", "robot", "sender", "who", "lost", "visibility",
    "missing", "note",
}  # fmt: skip


def island_of(page: str) -> dict[str, Any]:
    """Return the data that a page passes to the replay's script."""
    (island,) = re.findall(r'<script type="application/json">(.*?)</script>', page)
    return dict(json.loads(island))


def data_of(page: str) -> dict[str, Any]:
    """Return the data in a page."""
    return dict(json.loads(zlib.decompress(base64.b64decode(island_of(page)["deflated"]))))


def values_of(column: dict[str, Any]) -> np.ndarray:
    """Return a column as numbers, one row a tick."""
    parts = []
    for added in column["added"]:
        total, values = 0, []
        for step in added:
            total += step or 0
            values.append(np.nan if step is None else total / column["per"])
        parts.append(values)
    return np.array(parts).T


def long_recording(ticks: int, images: int = 0) -> Recording:
    """Return a recording with this many ticks and images, of random content that does not compress."""
    one = line_follower_recording(150)
    times = -(-ticks // 150)
    chance = np.random.default_rng(0)
    columns: dict[str, Any] = {
        each.name: np.concatenate([getattr(one.ticks, each.name)] * times)[:ticks]
        + (chance.integers(0, 3000, (ticks, each.width)) if each.whole else 0)
        for each in COLUMNS
    }
    seconds = ticks / 30
    taken = tuple(
        Image(index * seconds / images, 0, Pose(500, 400, 0), chance.bytes(1600), chance.bytes(1600), 0)
        for index in range(images)
    )
    return replace(one, ticks=Ticks(**columns), end_t=seconds, images=taken)


def poisoned(data: Any, text: str, key: str = "") -> Any:
    """Return the same data with every text replaced by ``text``."""
    if dataclasses.is_dataclass(data) and not isinstance(data, type):
        changed = {each.name: poisoned(getattr(data, each.name), text, each.name) for each in dataclasses.fields(data)}
        return replace(data, **changed)
    if isinstance(data, Mapping):
        return {each: poisoned(value, text, each) for each, value in data.items()}
    if isinstance(data, list | tuple):
        return type(data)(poisoned(value, text, key) for value in data)
    return text if type(data) is str and key not in _NO_TEXTS else data


def parting_grade(after: int = 90) -> Grade:
    """Return the line follower's grade for another attempt: after tick ``after`` it drives straight on for 12 s."""
    grade = line_follower_grade()

    def other(trial: TrialResult) -> TrialResult:
        recording = trial.recording
        old, steps = recording.ticks, np.arange(1, 361 - after)
        way = [old.x[after - 1] - old.x[after - 2], old.y[after - 1] - old.y[after - 2]]
        straight = {
            "x": old.x[after - 1] + way[0] * steps,
            "y": old.y[after - 1] + way[1] * steps,
            "heading": np.full(len(steps), old.heading[after - 1]),
        }
        columns: dict[str, Any] = {
            each.name: np.concatenate([getattr(old, each.name)[:after], straight[each.name]])
            if each.name in straight
            else np.resize(getattr(old, each.name), (360, *getattr(old, each.name).shape[1:]))
            for each in COLUMNS
        }
        end = Pose(*(float(columns[name][-1]) for name in ("x", "y", "heading")))
        speech = (TimedText(0.5, "off I go"), TimedText(3.5, "straight on"), TimedText(11.5, "there"))
        ticks = Ticks(**columns)
        return replace(
            trial, recording=replace(recording, ticks=ticks, end=end, end_t=12.0, printed=(), spoken=speech, touches=())
        )

    return replace(grade, trials=tuple(other(trial) for trial in grade.trials))
