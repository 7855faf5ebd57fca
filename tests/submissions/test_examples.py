"""Every example and every failing submission, graded for real: marks, verdict and the student's messages."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from paths import DATA
from service.grading import (
    hint_agents,
    hint_answers,
    hint_braces,
    hint_files,
    hint_formulas,
    hint_logic,
    hint_outputs,
    hint_passes,
    hint_repetition,
    hint_scale,
    hint_signatures,
    hint_slips,
    hint_structure,
    hint_thresholds,
    hint_timing,
    hint_values,
)
from service.grading.example_check import check_examples
from service.grading.grade import CriterionResult, Grade, TrialResult
from service.grading.grader import grade
from service.grading.hint_clues import collect_clues
from service.grading.hints import Rule, collect_accepted_differences, collect_near_misses
from service.grading.run_plan import RunPlan
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from submissions.assignment.examples import ExpectedResult, read_example, read_expected
from submissions.assignment.folder import REFERENCE, list_catalogue_ids
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.criteria import Criterion
from submissions.criteria.common import CriterionWithStrays
from submissions.criteria.logs import Datalog
from submissions.criteria.texts import TextSequence
from submissions.stored_submission import pack_submission, unpack_submission
from submissions.submission import Submission

#: Their examples take nine tenths of the total time: dozens of trials, minutes on the track, or training.
_LONG = frozenset(
    {
        "black-or-grey",
        "bounding-boxes",
        "braitenberg-seek",
        "calibrate-on-lollipop",
        "colour-under-sensor",
        "digit-column",
        "drive-into-range",
        "grey-band-readings",
        "image-parser",
        "json-queue",
        "log-bands",
        "parser-agent-and-logger",
        "relay-a-message",
        "sensor-diameters",
        "shape-recognition",
        "stay-inside",
        "three-greys",
        "track-width",
        "turn-until-answered",
        "two-sensor-line-follower",
        "ultrasonic-stop",
        "braitenberg-avoid",
        "collect-shapes",
        "dead-reckoning-with-noise",
        "digits-off-centre",
        "fastest-lap-of-thruxton",
        "follow-a-shape-and-log-the-gyro",
        "follow-the-leader",
        "lollipop",
        "lossy-echo",
        "meet-at-the-shape",
        "single-sensor-edge-follower",
        "digits-on-a-sheet",
        "labelled-digits",
        "lollipop-with-noise",
        "mlp-against-cnn",
        "rules-without-a-network",
        "shape-at-random",
        "shapes-off-centre",
        "shapes-on-a-track",
        "shapes-on-the-move",
        "train-a-recogniser",
    }
)
_ASSIGNMENTS = [
    pytest.param(name, marks=[pytest.mark.long] * (name in _LONG), id=name) for name in list_catalogue_ids()
]
FOLDER = DATA / "failing_submissions"
FAILING: Mapping[str, Mapping[str, Any]] = tomllib.loads((FOLDER / "expected.toml").read_text())


def grade_example(assignment: str, name: str, runner: TrialRunner) -> Grade:
    return grade(read_example(assignment, name), find_assignment(assignment), runner=runner)


def grade_failing(name: str, runner: TrialRunner) -> Grade:
    assignment = find_assignment("echo-responder")
    return grade(read_submission(FOLDER / name, required_parts=assignment.parts), assignment, runner=runner)


def assert_as_expected(result: Grade, wanted: ExpectedResult) -> None:
    messages = "\n".join(criterion.message for criterion in result.criteria)
    assert (str(result.verdict), result.marks) == (wanted.verdict, wanted.marks), messages
    for phrase in wanted.feedback:
        assert phrase in messages


def rules_that_prove() -> Iterator[Rule]:
    """Return the rules that must report nothing for a correct program, even if marks are lost."""
    modules = (
        hint_agents,
        hint_answers,
        hint_braces,
        hint_files,
        hint_formulas,
        hint_repetition,
        hint_signatures,
        hint_slips,
        hint_logic,
        hint_outputs,
        hint_passes,
        hint_scale,
        hint_structure,
        hint_thresholds,
        hint_timing,
        hint_values,
    )
    for module in modules:
        yield from (each for name, each in vars(module).items() if name.startswith("hint_about_"))


@pytest.mark.parametrize("assignment", _ASSIGNMENTS)
def test_every_example_is_marked_as_expected(
    assignment: str, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    alarms: list[str] = []

    def hints_whatever_the_marks(
        submission: Submission,
        plan: RunPlan,
        trials: Sequence[TrialResult],
        results: Sequence[CriterionResult],
        _heartbeat: Callable[[], None],
    ) -> tuple[str, ...]:
        if all(result.marks >= result.max_marks for result in results):
            clues = collect_clues(submission, plan, trials, results)
            alarms.extend((*collect_near_misses(clues), *collect_accepted_differences(clues)))
            alarms.extend(result.for_staff for result in results if "more than it shows" in result.for_staff)
            as_lost = replace(clues, lost=plan.assignment.criteria, results=tuple(results))
            alarms.extend(sentence for rule in rules_that_prove() for sentence in rule(as_lost))
        return ()

    monkeypatch.setattr("service.grading.hints._log.warning", lambda *cause, **_: alarms.append(str(cause)))
    monkeypatch.setattr("service.grading.grader.collect_hints", hints_whatever_the_marks)
    checked = check_examples(assignment, runner=runner)
    assert checked.problems == ()
    assert alarms == []
    names = [example.name for example in checked.examples]
    full = checked.assignment.max_marks
    assert names[0] == REFERENCE
    assert checked.examples[0].marks == full
    assert any(example.marks is not None and example.marks < full for example in checked.examples[1:])


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(FAILING))
def test_failing_submission_gets_a_verdict_or_one_sentence(name: str, runner: TrialRunner) -> None:
    wanted = FAILING[name]
    if "refused" in wanted:
        with pytest.raises(UsageError) as refusal:
            grade_failing(name, runner)
        assert str(refusal.value) == wanted["refused"]
    else:
        assert_as_expected(grade_failing(name, runner), ExpectedResult(**wanted))


def test_every_failing_submission_has_an_expectation() -> None:
    assert {path.name for path in FOLDER.iterdir() if path.is_dir()} == set(FAILING)


@pytest.mark.long
def test_what_the_database_keeps_is_graded_alike(runner: TrialRunner) -> None:
    assignment = find_assignment("shape-at-random")
    submission = read_example(assignment.id, "flawed")
    kept = unpack_submission(pack_submission(submission))
    first, second = grade(submission, assignment, runner=runner), grade(kept, assignment, runner=runner)
    assert [trial.recording.sha256 for trial in first.trials] == [trial.recording.sha256 for trial in second.trials]
    assert (first.submission, first.criteria) == (second.submission, second.criteria)


def test_seed_echo_has_three_exchanges_and_ends_with_all_done(runner: TrialRunner) -> None:
    recording = grade_example("echo-responder", "seed", runner).trials[0].recording
    assert [(message.sender, message.text) for message in recording.messages] == [
        (sender, text)
        for number in (0, 2, 4)
        for sender, text in (("robot", f"PY::{number}"), ("responder", f"Python saw >> {number} << that..."))
    ]
    assert [line.text for line in recording.spoken] == ["all done"]
    assert recording.responder_log.count("---") == 3


def test_seed_json_queue_grows_by_one_a_message(runner: TrialRunner) -> None:
    recording = grade_example("json-queue", "seed", runner).trials[0].recording
    queues = [line.text.count("Py saw") for line in recording.printed if line.text.startswith("Message queue")]
    assert queues == [0, 1, 1, 2, 2, 3]
    assert recording.spoken[-1].text == "Last Python message was ...Py saw: 4"


def test_seed_names_all_six_shapes_and_says_so(runner: TrialRunner) -> None:
    result = grade_example("shape-recognition", "seed", runner)
    assert result.accuracy is not None
    assert (result.accuracy.value, result.accuracy.n) == (1.0, 6)
    page_text = {(t.recording.start.x, t.recording.start.y): t.recording.spoken[-1].text for t in result.trials}
    assert page_text[520, 900] == "Is that a upwards facing triangle"


def sought(criterion: Criterion) -> bool:
    """Return whether the criterion searches for a particular item, other than any item or the last text."""
    if not isinstance(criterion, CriterionWithStrays) or (
        isinstance(criterion, Datalog) and criterion.measured is None
    ):
        return False
    if not isinstance(criterion, TextSequence):
        return True
    any_text = criterion.matches == r"\w" or not (criterion.has_conditions or criterion.in_order)
    return not (criterion.last or any_text)


@pytest.mark.long
@pytest.mark.parametrize("assignment", list_catalogue_ids())
def test_naming_everything_earns_less_than_a_third_of_each_criterion_that_looks_among_much(assignment: str) -> None:
    graded_assignment = [criterion for criterion in find_assignment(assignment).criteria if sought(criterion)]
    if graded_assignment:
        earned = read_expected(assignment).examples["spray-and-pray"].earns
        assert [each.id for each in graded_assignment if 3 * earned[each.id] >= each.marks] == []
