"""Criteria that give marks only with another one: ``needs``."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest

from assignment_texts import build_run_text
from judging import START, criterion, lines, recorded
from service.grading.grade import CriterionResult, TrialResult
from service.grading.judging.judge import judge
from sim.recording import Recording
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.criteria import Criterion

_SAYS = criterion("says", id="says", title="Says it", equals="now")
_ENDS = criterion("finishes", id="ends", needs="says")


def _judge(
    criteria: tuple[Criterion, ...], *recordings: Recording, visibility: str = "visible"
) -> dict[str, CriterionResult]:
    scenario = Scenario("s", (START,), trials=len(recordings))
    assignment = Assignment("a", "A", WorldSpec(), Parts(), (scenario,), criteria)
    trials = tuple(TrialResult("s", index, 1, 0.0, 0.0, visibility, each) for index, each in enumerate(recordings))
    return {result.id: result for result in judge(assignment, trials)}


def _speak(text: str) -> Recording:
    return recorded(spoken=lines(text))


@pytest.mark.parametrize(
    ("texts", "marks"), [(["now"], 4), (["then"], 0), (["now", "then"], 4), (["now", "then", "then"], 0)]
)
def test_marks_need_half_of_the_marks_of_the_other(texts: list[str], marks: int) -> None:
    results = _judge((_ENDS, _SAYS), *map(_speak, texts))
    assert results["ends"].marks == marks
    assert list(results) == ["ends", "says"]
    withheld = 'This gives no marks, because "Says it" has less than half of its marks.'
    assert results["ends"].message.endswith(withheld) == (marks == 0)
    assert all(evidence.passed for evidence in results["ends"].evidence)


def test_what_is_lost_anyway_says_nothing_about_the_other() -> None:
    lost = criterion("prints", id="prints", equals="now", needs="says")
    assert "less than half" not in _judge((lost, _SAYS), _speak("then"))["prints"].message


def test_needs_may_follow_each_other() -> None:
    stays = criterion("displacement", id="stays", title="Stays", distance=[0, 200], needs="ends")
    assert [result.marks for result in _judge((stays, _ENDS, _SAYS), _speak("now")).values()] == [4, 4, 4]
    assert [result.marks for result in _judge((stays, _ENDS, _SAYS), _speak("then")).values()] == [0, 0, 0]


def test_students_read_the_reason_also_if_trials_are_hidden() -> None:
    shown = _judge((_ENDS, _SAYS), _speak("then"), visibility="hidden")["ends"].shown
    assert shown is not None
    assert "less than half" in shown.message


def _read(folder: Path, of_ends: str, of_says: str) -> Assignment:
    says = f'id = "says"\ntitle = "Says it"\nmarks = 3\ncheck = "says"\nequals = "now"\n{of_says}\n'
    seen = 'id = "seen"\ntitle = "Is seen"\nmarks = 0\ncheck = "says"\nequals = "now"\n'
    (folder / "assignment.toml").write_text(build_run_text("task", says, seen, ends=of_ends))
    return read_assignment(folder)


def test_an_assignment_says_what_a_criterion_needs(tmp_path: Path) -> None:
    assignment = _read(tmp_path, 'needs = "says"', "")
    assert [each.needs for each in assignment.criteria] == ["says", None, None]
    assert assignment.max_marks == Decimal(5)


@pytest.mark.parametrize(
    ("of_ends", "of_says", "problem"),
    [
        ('needs = "say"', "", 'needs is "say", expected the id of another criterion with marks; did you mean "says"?'),
        ('needs = "ends"', "", 'needs is "ends", expected the id of another criterion with marks'),
        ('needs = "seen"', "", 'needs is "seen", expected the id of another criterion with marks'),
        ('needs = "says"', 'needs = "ends"', 'needs is "says", which leads in a circle, expected none'),
        ('needs = "says"', 'visibility = "hidden"', 'needs is "says", which students do not see'),
    ],
)
def test_needs_that_make_no_sense_are_refused(of_ends: str, of_says: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(AssignmentProblems) as refusal:
        _read(tmp_path, of_ends, of_says)
    assert any(problem in each for each in refusal.value.problems), refusal.value.problems
