"""``verify`` distinguishes a program with its own random numbers from a host fault by repeating what differs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal

import pytest

from responders.source_file import SourceFile
from service.commands.verification import _compare_marks, _compare_trials, _find_cause, _grade_again
from service.grading.grade import Grade, TrialResult
from service.grading.grader import grade
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from sim.recording import TimedText, Verdict
from submissions.assignment.reader import find_assignment
from submissions.grading_request import GradingRequest
from submissions.seeds import PUBLIC_SECRET
from submissions.submission import Submission


def _stored_otherwise(graded: Grade) -> list[tuple[TrialResult, TrialResult]]:
    """Return the trials to compare if the stored recordings had other hashes."""
    return [(replace(each, recording=replace(each.recording, sha256="0" * 64)), each) for each in graded.trials]


def _repeating(request: GradingRequest) -> Callable[[int], Grade]:
    return lambda earlier: _grade_again(request, PUBLIC_SECRET, PoolExtent.WHOLE, earlier)


@pytest.mark.parametrize(
    ("program", "cause"),
    [
        ("import os\nprint(os.getpid())", "program"),
        ("import ctypes\nprint(ctypes.CDLL(None).clock() % 1000, 'and so on')", "program"),
        ("for word in {'a', 'b', 'c'}: print(word, hash(word))", "grader"),
    ],
)
def test_a_trial_that_differs_is_repeated_in_fresh_processes(program: str, cause: str, runner: TrialRunner) -> None:
    request = GradingRequest(Submission("ada", SourceFile("robot.py", program)), find_assignment("say-tm129"), "ada")
    again = grade(request.submission, request.assignment, runner=runner)
    assert _find_cause(_stored_otherwise(again), [], again, _repeating(request)) == cause
    assert _find_cause(list(zip(again.trials, again.trials, strict=True)), [], again, _repeating(request)) is None


def _graded(runner: TrialRunner) -> tuple[GradingRequest, Grade]:
    request = GradingRequest(
        Submission("ada", SourceFile("robot.py", "say('ok')")), find_assignment("say-tm129"), "ada"
    )
    return request, grade(request.submission, request.assignment, runner=runner)


def _cut(trial: TrialResult, *messages: str) -> TrialResult:
    """Return the trial as if a limit had ended it after this speech."""
    spoken = tuple(TimedText(0.0, text) for text in messages)
    recording = replace(trial.recording, sha256="0" * 64, verdict=Verdict.CPU_LIMIT, spoken=spoken, faults=())
    return replace(trial, recording=recording)


@pytest.mark.parametrize(
    ("before", "after", "compared"),
    [((), ("ok",), "cut by a limit"), (("ok",), ("ok", "a"), "cut by a limit"), (("no",), ("ok",), "differs")],
)
def test_a_trial_that_was_cut_has_to_begin_alike(
    before: tuple[str, ...], after: tuple[str, ...], compared: str, runner: TrialRunner
) -> None:
    trial = _graded(runner)[1].trials[0]
    other = _cut(trial, *after)
    other = replace(other, recording=replace(other.recording, sha256="1" * 64))
    assert _compare_trials(_cut(trial, *before), other) == compared


def test_only_criteria_that_look_at_a_cut_trial_may_differ(runner: TrialRunner) -> None:
    request, again = _graded(runner)
    stored = replace(again, criteria=tuple(replace(each, marks=Decimal(-1)) for each in again.criteria))
    cut = [(_cut(each), each) for each in again.trials]
    criteria = request.assignment.criteria
    assert set(_compare_marks(stored, again, cut, criteria)) == {"cut by a limit"}
    elsewhere = [each.model_copy(update={"scenarios": ("another",)}) for each in criteria]
    assert set(_compare_marks(stored, again, cut, elsewhere)) == {"differs"}
    whole = [(each, each) for each in again.trials]
    assert set(_compare_marks(stored, again, whole, criteria)) == {"differs"}


@pytest.mark.parametrize(("others", "cause"), [((5, 2), "program"), ((2, 5), "program"), ((5, 5), None)])
def test_a_limit_hides_no_chance_of_a_program(others: tuple[int, int], cause: str | None, runner: TrialRunner) -> None:
    """A program can run into a limit by chance. Marks that differ there are repeated as well."""
    _, again = _graded(runner)

    def with_marks(marks: int) -> Grade:
        return replace(again, criteria=tuple(replace(each, marks=Decimal(marks)) for each in again.criteria))

    grades = iter(map(with_marks, others))
    rows = [(_cut(each), each) for each in again.trials]
    marks = ["cut by a limit"] * len(again.criteria)
    assert _find_cause(rows, marks, with_marks(5), lambda _: next(grades)) == cause


def test_marks_that_differ_have_a_cause_without_trials(runner: TrialRunner) -> None:
    request, again = _graded(runner)
    assert _find_cause([], ["differs"], again, _repeating(request)) == "grader"
    assert _find_cause([], ["same"], again, _repeating(request)) is None
