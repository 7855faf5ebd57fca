"""A replay as a JSON-serialisable document: the trials of a grade, or one run, with floors and source.

It contains exactly what the reader's view contains. ``html.py`` makes the page that plays it.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from service.grading.grade import TrialResult
from service.language import ENGLISH, Language
from service.reports.display_text import to_one_line
from service.reports.floor_image import encode_built_in_floor, encode_floor
from service.reports.replay.overlay import overlay_to_json
from service.reports.replay.sources import Sources, collect_sources
from service.reports.replay.trial import trial_to_json
from service.reports.view import NO_OVERLAY, OverlayTrials, View, find_worst_trial, list_scenarios
from sim.floors import list_floor_names
from sim.floors.canvas import Pixels as Pixels
from sim.recording import Recording
from submissions.submission import Submission

FORMAT, VERSION = "robomark replay", 1
#: The compressed size limit of a report's trials together. The first trial is always included.
REPORT_BYTES = 300_000
_NO_FLOORS: Mapping[str, Pixels] = MappingProxyType({})


def build_grade_replay(
    view: View,
    submission: Submission | None = None,
    own_floors: Mapping[str, Pixels] = _NO_FLOORS,
    max_bytes: float = math.inf,
    overlay_trials: OverlayTrials = NO_OVERLAY,
) -> dict[str, Any]:
    """Return the trials of the view: first the worst of each scenario, then the others.

    It includes as many as fit into ``max_bytes`` when compressed, and at least one. ``own_floors`` are floors that are
    not built in, by name. ``overlay_trials`` are drawn over the trials of the same index.
    """
    grade = view.grade
    worst_trials = [find_worst_trial(grade, scenario) for scenario in list_scenarios(grade)]
    order = dict.fromkeys([*worst_trials, *range(len(grade.trials))])
    sources = collect_sources(submission)
    chosen_trials: dict[int, dict[str, Any]] = {}
    remaining_bytes = max_bytes
    for index in order:
        trial_data = {
            **trial_to_json(grade.trials[index], sources, grade.criteria, index, view.language),
            **_build_overlay(grade.trials, index, overlay_trials, view.language),
        }
        remaining_bytes -= len(compress_replay(trial_data)) if max_bytes < math.inf else 0
        if remaining_bytes < 0 and chosen_trials:
            break
        chosen_trials[index] = trial_data
    title = f"{grade.assignment_title}: {grade.student}"
    kept_indices = sorted(chosen_trials)
    trials = [(grade.trials[index], chosen_trials[index]) for index in kept_indices]
    first_index = kept_indices.index(worst_trials[0]) if kept_indices else 0
    return {**_build_document(title, trials, sources, own_floors), "of": len(grade.trials), "first": first_index}


def build_run_replay(
    recording: Recording,
    name: str,
    seed: int,
    sources: Sources,
    own_floors: Mapping[str, Pixels],
    overlay_trials: OverlayTrials = NO_OVERLAY,
) -> dict[str, Any]:
    """Return the replay of one unmarked run, in English."""
    trial = TrialResult(name, 0, seed, 0, 0, "visible", recording)
    trial_data = {
        **trial_to_json(trial, sources),
        **_build_overlay((trial,), 0, overlay_trials, ENGLISH),
        "name": to_one_line(name, 60),
    }
    return {**_build_document(name, [(trial, trial_data)], sources, own_floors), "of": 1, "first": 0}


def compress_replay(document: Mapping[str, Any]) -> bytes:
    """Return the document's JSON, compressed in a format that every browser can read."""
    return zlib.compress(json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii"), 6)


def _build_overlay(
    trials: Sequence[TrialResult], index: int, overlay_trials: OverlayTrials, language: Language
) -> dict[str, Any]:
    other_trial = overlay_trials.trials.get(index)
    return (
        {}
        if other_trial is None
        else {"over": overlay_to_json(trials[index], other_trial, overlay_trials.name, language)}
    )


def _build_document(
    title: str,
    trials: Iterable[tuple[TrialResult, dict[str, Any]]],
    sources: Sources,
    own_floors: Mapping[str, Pixels],
) -> dict[str, Any]:
    numbers: dict[tuple[str, bool, int], int] = {}
    floors: list[dict[str, Any]] = []
    trial_documents = []
    for trial, data in trials:
        recording = trial.recording
        floor_key = (recording.background, recording.label_patches, recording.sheet)
        if floor_key not in numbers:
            numbers[floor_key] = len(floors)
            floors.append(_floor_to_json(recording, own_floors))
        trial_documents.append({**data, "floor": numbers[floor_key]})
    return {
        "format": FORMAT,
        "version": VERSION,
        "title": to_one_line(title, 200),
        "floors": floors,
        "sources": [source.to_json() for source in sources.shown],
        "trials": trial_documents,
    }


def _floor_to_json(recording: Recording, own_floors: Mapping[str, Pixels]) -> dict[str, Any]:
    """Return the floor of the trial, without an image if it is not available any more."""
    own_floor = own_floors.get(recording.background)
    if own_floor is not None:
        image = encode_floor(own_floor)
    elif recording.background in list_floor_names():
        image = encode_built_in_floor(recording.background, recording.label_patches, recording.sheet)
    else:
        image = None
    return {"name": to_one_line(recording.background, 80), "image": image}
