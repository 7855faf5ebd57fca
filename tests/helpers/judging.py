"""Criteria, recordings of nothing in particular, and what the judge makes of them, for tests of what is judged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from service.grading.grade import CriterionResult, TrialResult
from service.grading.judging.judge import judge
from sim.recording import Line, Message, Pose, Recording, Ticks, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.criteria import SCHEMAS, Criterion

START = Pose(100, 800, 0)


def criterion(check: str, **keys: Any) -> Criterion:
    """One of this kind, as a table of an assignment gives it."""
    made = SCHEMAS[check].model_validate({"id": "c", "title": "C", "marks": "4", "check": check, **keys})
    assert isinstance(made, Criterion)
    return made


def recorded(**parts: Any) -> Recording:
    """A run of three seconds along x at 30 mm a second."""
    count = 90
    zeros, sums = np.zeros(count), np.zeros((count, 3), dtype=np.int64)
    x = 100 + np.arange(1, count + 1.0)
    values: dict[str, Any] = {
        "background": "Empty_Map",
        "start": START,
        "end": Pose(190, 800, 0),
        "end_t": 3.0,
        "ticks": Ticks(x, zeros + 800, zeros, zeros, zeros, sums, sums, zeros, zeros),
        "verdict": Verdict.FINISHED,
        "sha256": "0" * 64,
    }
    return Recording(**(values | parts))


def talk(*exchanges: tuple[str, str | None], arrives: bool = True) -> tuple[Message, ...]:
    """Each robot's text a second after the last, and its answer a tenth later."""
    messages: list[Message] = []
    for t, (text, answer) in enumerate(exchanges):
        asked = len(messages)
        messages.append(Message(float(t), "robot", text, float(t)))
        if answer is not None:
            note = "" if arrives else "undelivered"
            messages.append(Message(float(t), "responder", answer, t + 0.1 if arrives else None, asked, note))
    return tuple(messages)


def lines(*texts: str) -> tuple[Line, ...]:
    """A line a second."""
    return tuple(Line(float(t), text) for t, text in enumerate(texts))


def judged(
    asked: Criterion,
    *recordings: Recording,
    visibility: str = "visible",
    poses: Sequence[Pose] = (START,),
    motor_noise: float = 0.0,
) -> CriterionResult:
    """What a criterion gives for these recordings, as many trials from each pose as there are for it."""
    scenario = Scenario("s", tuple(poses), trials=max(len(recordings) // len(poses), 1))
    world = WorldSpec(recordings[0].background) if recordings else WorldSpec()
    assignment = Assignment("a", "A", world, Parts(), (scenario,), (asked,))
    trials = tuple(
        TrialResult("s", index, 1, 0.0, motor_noise, visibility, recording, place=index // scenario.trials)
        for index, recording in enumerate(recordings)
    )
    (result,) = judge(assignment, trials)
    assert 0 <= result.marks <= result.max_marks
    # One that looks at what was swept says nothing of a trial in which nothing was.
    assert len(result.evidence) == (0 if asked.check == "robustness" else len(recordings))
    return result
