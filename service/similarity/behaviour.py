"""Equal behaviour of robots in the same trials that is rare in the batch.

A trial's world, including its noise, is the same for everyone. Equal commands at equal times therefore give equal
paths, which alone proves nothing. A student's own ``random`` depends on the submission, so a copy that uses it may
behave differently.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from service.grading.grade import TrialResult
from sim.recording import Fault, Recording, Verdict
from sim.recording_values import collect_faults

Aspect = Literal["path", "messages", "faults"]
#: The smallest number of active students in a trial for which rarity can be judged.
MIN_STUDENTS = 8
#: The largest fraction of them that may share rare behaviour; always at least two.
RARE_FRACTION = 0.1

#: Changes between left and right that make a path winding: more than a planned path has.
WINDING_TURNS = 20

#: The machine decides how far such a trial gets.
_CUT_SHORT_VERDICTS = frozenset({Verdict.CPU_LIMIT, Verdict.MEMORY_LIMIT, Verdict.STALLED, Verdict.HOST_ERROR})


@dataclass(frozen=True, slots=True)
class TrialName:
    """A trial of an assignment. ``noisy`` means that light, motors or the channel were random."""

    scenario: str
    index: int
    noisy: bool


@dataclass(frozen=True, slots=True)
class SharedBehaviour:
    """A trial in which two students behaved equally: the aspect, how many shared it, and how many were active."""

    trial: TrialName
    aspect: Aspect
    sharing: int
    students: int


@dataclass(frozen=True, slots=True)
class Behaviour:
    """The compared data of a student's trials."""

    aspects: Mapping[tuple[TrialName, Aspect], str]  # a digest of each, if it occurred
    winding: frozenset[TrialName]  # trials with so many turns that the same path is unlikely by chance
    recordings: str  # a digest of all recordings; empty if a trial was cut short, or nothing happened

    @property
    def trials(self) -> int:
        """The number of comparable trials."""
        return len({trial for trial, _ in self.aspects})


def extract_behaviour(trials: Iterable[TrialResult]) -> Behaviour:
    """Return the data to compare of a student's trials, without those that the machine cut short."""
    trials = list(trials)
    compared_trials = [trial for trial in trials if trial.verdict not in _CUT_SHORT_VERDICTS]
    aspects = {
        (_build_trial_name(trial), aspect): digest
        for trial in compared_trials
        for aspect, digest in _digest_aspects(trial.recording)
    }
    has_actions = any(aspect != "faults" for _, aspect in aspects)
    is_complete = has_actions and len(compared_trials) == len(trials)
    return Behaviour(
        aspects,
        frozenset(
            _build_trial_name(trial) for trial in compared_trials if _count_turns(trial.recording) >= WINDING_TURNS
        ),
        _compute_digest(_encode_trial(trial) for trial in trials) if is_complete else "",
    )


def group_same_recordings(behaviours: Mapping[str, Behaviour]) -> tuple[tuple[str, ...], ...]:
    """Return groups of students with equal recordings, the largest first, however large."""
    groups: dict[str, list[str]] = defaultdict(list)
    for student in sorted(behaviours):
        groups[behaviours[student].recordings].append(student)
    groups.pop("", None)
    return tuple(
        sorted((tuple(each) for each in groups.values() if len(each) > 1), key=lambda each: (-len(each), each))
    )


def find_shared_behaviour(behaviours: Mapping[str, Behaviour]) -> dict[tuple[str, str], tuple[SharedBehaviour, ...]]:
    """Return the rare equal behaviour of each two students, by their names in order."""
    sharing: dict[tuple[TrialName, Aspect], dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    active: dict[TrialName, set[str]] = defaultdict(set)
    for student in sorted(behaviours):
        for (trial, aspect), digest in behaviours[student].aspects.items():
            sharing[trial, aspect][digest].append(student)
            active[trial].add(student)
    shared_behaviour: dict[tuple[str, str], list[SharedBehaviour]] = defaultdict(list)
    for (trial, aspect), groups in sorted(sharing.items(), key=lambda item: (item[0][0].scenario, item[0][0].index)):
        students = len(active[trial])
        max_students = max(2, RARE_FRACTION * students)
        for group in groups.values():
            if students >= MIN_STUDENTS and 2 <= len(group) <= max_students:
                for pair in combinations(group, 2):
                    shared_behaviour[pair].append(SharedBehaviour(trial, aspect, len(group), students))
    return {pair: tuple(same) for pair, same in shared_behaviour.items()}


def _build_trial_name(trial: TrialResult) -> TrialName:
    return TrialName(trial.scenario, trial.index, trial.light_noise > 0 or trial.motor_noise > 0)


def _digest_aspects(recording: Recording) -> Iterable[tuple[Aspect, str]]:
    robots = [recording] if recording.partner is None else [recording, recording.partner]
    if any(_has_moved(robot) for robot in robots):
        columns = [column for robot in robots for column in (robot.ticks.x, robot.ticks.y, robot.ticks.heading)]
        yield "path", _compute_digest(column.tobytes() for column in columns)
    texts = [
        f"{who}\n{text}"
        for robot in robots
        for who, text in (
            *((message.sender, message.text) for message in robot.messages),
            *(("printed", line.text) for line in robot.printed),
            *(("spoken", line.text) for line in robot.spoken),
        )
    ]
    if texts:
        yield "messages", _compute_digest(text.encode("utf-8", "surrogatepass") for text in texts)
    faults = [f"{fault.t} {fault.verdict} {fault.who} {fault.message}" for fault in _filter_faults(recording)]
    if faults:
        yield "faults", _compute_digest(fault.encode("utf-8", "surrogatepass") for fault in faults)


def _encode_trial(trial: TrialResult) -> bytes:
    return f"{trial.scenario} {trial.index} {trial.recording.sha256}".encode()


def _count_turns(recording: Recording) -> int:
    """Return how often the robot changed between turning left and turning right."""
    directions = np.sign(np.diff(recording.ticks.heading).round(3))
    directions = directions[directions != 0]
    return int(np.count_nonzero(directions[1:] != directions[:-1]))


def _has_moved(recording: Recording) -> bool:
    ticks = recording.ticks
    return len(ticks) > 0 and bool((ticks.x != ticks.x[0]).any() or (ticks.heading != ticks.heading[0]).any())


def _filter_faults(recording: Recording) -> list[Fault]:
    """Return the faults without time limits, because many programs may run forever."""
    return [fault for fault in collect_faults(recording) if fault.verdict is not Verdict.TIME_LIMIT]


def _compute_digest(pieces: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for piece in pieces:
        digest.update(b"%d\n" % len(piece))
        digest.update(piece)
    return digest.hexdigest()
