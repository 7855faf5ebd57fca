"""A replay as a JSON-serialisable document: the trials of a grade, or one run, with floors and source.

It contains exactly what the reader's view contains. ``html.py`` makes the page that plays it.
"""

from __future__ import annotations

import base64
import io
import json
import math
import zlib
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from service.grading.grade import TrialResult
from service.language import ENGLISH, Language
from service.reports.display_text import to_one_line
from service.reports.replay.overlay import overlay_to_json
from service.reports.replay.sources import Sources, collect_sources
from service.reports.replay.trial import trial_to_json
from service.reports.view import NO_OVERLAY, OverlayTrials, View, find_worst_trial, list_scenarios
from sim.floors import build_floor, list_floor_names
from sim.recording import Recording
from submissions.submission import Submission

Pixels = NDArray[np.uint8]
FORMAT, VERSION = "robomark replay", 1
#: The compressed size limit of a report's trials together. The first trial is always included.
REPORT_BYTES = 300_000
_FLOOR_BYTES = 120_000
_NO_FLOORS: Mapping[str, Pixels] = MappingProxyType({})


def build_grade_replay(
    view: View,
    submission: Submission | None = None,
    own_floors: Mapping[str, Pixels] = _NO_FLOORS,
    most_bytes: float = math.inf,
    others: OverlayTrials = NO_OVERLAY,
) -> dict[str, Any]:
    """Return the trials of the view: first the worst of each scenario, then the others.

    It includes as many as fit into ``most_bytes`` when compressed, and at least one. ``own_floors`` are floors that are
    not built in, by name. ``others`` are drawn over the trials of the same index.
    """
    grade = view.grade
    worst = [find_worst_trial(grade, scenario) for scenario in list_scenarios(grade)]
    order = dict.fromkeys([*worst, *range(len(grade.trials))])
    sources = collect_sources(submission)
    chosen: dict[int, dict[str, Any]] = {}
    left = most_bytes
    for index in order:
        told = {
            **trial_to_json(grade.trials[index], sources, grade.criteria, index, view.language),
            **_build_overlay(grade.trials, index, others, view.language),
        }
        left -= len(compress_replay(told)) if most_bytes < math.inf else 0
        if left < 0 and chosen:
            break
        chosen[index] = told
    title = f"{grade.assignment_title}: {grade.student}"
    kept = sorted(chosen)
    trials = [(grade.trials[index], chosen[index]) for index in kept]
    first = kept.index(worst[0]) if kept else 0
    return {**_build_document(title, trials, sources, own_floors), "of": len(grade.trials), "first": first}


def build_run_replay(
    recording: Recording,
    name: str,
    seed: int,
    sources: Sources,
    own_floors: Mapping[str, Pixels],
    others: OverlayTrials = NO_OVERLAY,
) -> dict[str, Any]:
    """Return the replay of one unmarked run, in English."""
    trial = TrialResult(name, 0, seed, 0, 0, "visible", recording)
    told = {
        **trial_to_json(trial, sources),
        **_build_overlay((trial,), 0, others, ENGLISH),
        "name": to_one_line(name, 60),
    }
    return {**_build_document(name, [(trial, told)], sources, own_floors), "of": 1, "first": 0}


def compress_replay(document: Mapping[str, Any]) -> bytes:
    """Return the document's JSON, compressed in a format that every browser can read."""
    return zlib.compress(json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii"), 6)


def _build_overlay(
    trials: Sequence[TrialResult], index: int, others: OverlayTrials, language: Language
) -> dict[str, Any]:
    other = others.trials.get(index)
    return {} if other is None else {"over": overlay_to_json(trials[index], other, others.name, language)}


def _build_document(
    title: str,
    trials: Iterable[tuple[TrialResult, dict[str, Any]]],
    sources: Sources,
    own_floors: Mapping[str, Pixels],
) -> dict[str, Any]:
    numbers: dict[tuple[str, bool, int], int] = {}
    floors: list[dict[str, Any]] = []
    told = []
    for trial, data in trials:
        recording = trial.recording
        ground = (recording.background, recording.label_patches, recording.sheet)
        if ground not in numbers:
            numbers[ground] = len(floors)
            floors.append(_floor_to_json(recording, own_floors))
        told.append({**data, "floor": numbers[ground]})
    return {
        "format": FORMAT,
        "version": VERSION,
        "title": to_one_line(title, 200),
        "floors": floors,
        "sources": [source.to_json() for source in sources.shown],
        "trials": told,
    }


def _floor_to_json(recording: Recording, own_floors: Mapping[str, Pixels]) -> dict[str, Any]:
    """Return the floor of the trial, without an image if it is not available any more."""
    own = own_floors.get(recording.background)
    if own is not None:
        image = _encode_image(own)
    elif recording.background in list_floor_names():
        image = _encode_built_in(recording.background, recording.label_patches, recording.sheet)
    else:
        image = None
    return {"name": to_one_line(recording.background, 80), "image": image}


@lru_cache(maxsize=12)
def _encode_built_in(name: str, labels: bool, sheet: int) -> str:
    return _encode_image(build_floor(name, labels=labels, seed=sheet).pixels)


def _encode_image(pixels: Pixels) -> str:
    """Return the image as a data URI: lossless if that is small, as for printed floors, otherwise lossy."""
    image = Image.fromarray(np.ascontiguousarray(pixels[:, :, :3]))
    data = _encode_webp(image, lossless=True, method=2)
    if len(data) > _FLOOR_BYTES:
        data = _encode_webp(image.resize((image.width // 2, image.height // 2)), quality=70)
    return f"data:image/webp;base64,{base64.b64encode(data).decode('ascii')}"


def _encode_webp(image: Image.Image, **how: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, "WEBP", **how)
    return buffer.getvalue()
