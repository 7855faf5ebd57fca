"""Criteria, generic recordings, and calls of the judge, for tests of judging."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from service.grading.grade import CriterionResult, TrialResult
from service.grading.judging.judge import judge
from sim.recording import Message, Pose, Recording, Ticks, TimedText, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.criteria import SCHEMAS, Criterion

START = Pose(100, 800, 0)


def criterion(check: str, **keys: Any) -> Criterion:
    """Return a criterion of this kind, as read from an assignment table."""
    made = SCHEMAS[check].model_validate({"id": "c", "title": "C", "marks": "4", "check": check, **keys})
    assert isinstance(made, Criterion)
    return made


def recorded(**parts: Any) -> Recording:
    """Return a run of three seconds along x at 30 mm/s."""
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
    """Return messages of the robot, a second apart, each with an answer a tenth of a second later."""
    messages: list[Message] = []
    for t, (text, answer) in enumerate(exchanges):
        message_count = len(messages)
        messages.append(Message(float(t), "robot", text, float(t)))
        if answer is not None:
            note = "" if arrives else "undelivered"
            messages.append(Message(float(t), "responder", answer, t + 0.1 if arrives else None, message_count, note))
    return tuple(messages)


def lines(*texts: str) -> tuple[TimedText, ...]:
    """Return one line per second."""
    return tuple(TimedText(float(t), text) for t, text in enumerate(texts))


def judged(
    rule: Criterion,
    *recordings: Recording,
    visibility: str = "visible",
    poses: Sequence[Pose] = (START,),
    motor_noise: float = 0.0,
) -> CriterionResult:
    """Judge these recordings by a criterion, with as many trials from each pose as there are recordings."""
    scenario = Scenario("s", tuple(poses), trials=max(len(recordings) // len(poses), 1))
    world = WorldSpec(recordings[0].background) if recordings else WorldSpec()
    assignment = Assignment("a", "A", world, Parts(), (scenario,), (rule,))
    trials = tuple(
        TrialResult("s", index, 1, 0.0, motor_noise, visibility, recording, place=index // scenario.trials)
        for index, recording in enumerate(recordings)
    )
    (result,) = judge(assignment, trials)
    assert 0 <= result.marks <= result.max_marks
    # A criterion about sweeps has no result for a trial without a sweep.
    assert len(result.evidence) == (0 if rule.check == "robustness" else len(recordings))
    return result
