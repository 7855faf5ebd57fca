"""Causes of lost marks, found by running trials again: real trials of small assignments."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.reruns.causes import Cause, find_causes
from service.grading.reruns.engine import Budget, BudgetSpent, RerunEngine
from service.grading.reruns.exchanges import AnswersFrom, GivenPart, WithoutMessageLoss
from service.grading.reruns.grade_causes import add_causes
from service.grading.reruns.halves import list_student_parts, plan_reference
from service.grading.run_plan import plan_run
from service.grading.trial_runner import TrialRunner
from service.mutation.source_tree import SourceTree
from submissions.assignment.definition import Assignment, Reruns
from submissions.assignment.examples import read_example
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission


def read(name: str) -> tuple[Assignment, Submission]:
    assignment = replace(find_assignment(name), reruns=Reruns(halves=True))
    return assignment, read_example(name, "reference")


def exchanged(submission: Submission, **replacements: tuple[str, str]) -> Submission:
    """Return the submission with one text of its program or responder replaced by another."""
    for part, (old, new) in replacements.items():
        code = submission.program if part == "program" else submission.responder
        assert code is not None
        assert code.text.count(old) == 1
        changed = SourceFile(code.name, code.text.replace(old, new))
        submission = (
            replace(submission, program=changed) if part == "program" else replace(submission, responder=changed)
        )
    return submission


def explain(runner: TrialRunner, name: str, submission: Submission) -> Grade:
    """Return the grade with causes. Only runs are limited, because the speed of the machine must not matter."""
    assignment, reference = read(name)
    graded = grade(submission, assignment, runner=runner)
    return add_causes(
        graded, submission, assignment, runner, reference=reference, budget=Budget(cpu_seconds=1e9, sleep_seconds=1e9)
    )


def explained(runner: TrialRunner, name: str, **replacements: tuple[str, str]) -> dict[str, str]:
    graded = explain(runner, name, exchanged(read(name)[1], **replacements))
    return {cause.criterion: cause.text for cause in graded.causes}


def test_rerun_without_exchange_repeats_the_recordings(runner: TrialRunner) -> None:
    assignment, reference = read("lossy-echo")
    graded = grade(reference, assignment, runner=runner)
    engine = RerunEngine(runner, plan_run(reference, assignment), graded)
    rerun = engine.rerun((0, 1), ())
    assert {index: each.sha256 for index, each in rerun.recordings.items()} == {
        index: graded.trials[index].recording.sha256 for index in (0, 1)
    }
    assert {name: outcome.marks for name, outcome in rerun.outcomes.items()} == {
        result.id: result.marks for result in graded.criteria
    }
    assert engine.rerun((0, 1), ()) is rerun
    assert engine.spent.runs == 2


def test_budget_ends_the_reruns_and_marks_do_not_change(runner: TrialRunner) -> None:
    assignment, reference = read("lossy-echo")
    submission = read_example("lossy-echo", "sends-once")
    graded = grade(submission, assignment, runner=runner)
    engine = RerunEngine(runner, plan_run(submission, assignment), graded, budget=Budget(runs=1))
    engine.rerun((0,), (WithoutMessageLoss(),))
    with pytest.raises(BudgetSpent):
        engine.rerun((1,), (WithoutMessageLoss(),))
    engine.start_cause(Budget(cpu_seconds=0.0001))
    with pytest.raises(BudgetSpent):
        engine.rerun((1,), (WithoutMessageLoss(),))
    few = add_causes(graded, submission, assignment, runner, reference=reference, budget=Budget(runs=0))
    assert few.causes == ()
    assert few == graded
    without_causes = replace(assignment, reruns=Reruns(causes=False))
    assert add_causes(graded, submission, without_causes, runner, reference=reference).causes == ()


def test_lost_messages_are_the_cause_for_a_program_that_sends_once(runner: TrialRunner) -> None:
    graded = explain(runner, "lossy-echo", read_example("lossy-echo", "sends-once"))
    causes = {cause.criterion: cause for cause in graded.causes}
    assert re.search(r"With a message loss of [\d.]+ %, one failed trial passes; with", causes["resends"].text)
    assert set(causes) == {result.id for result in graded.criteria if result.marks < result.max_marks}
    assert "the program loses the marks" in causes["resends"].text
    assert "With no message lost, the same submission gets all 4 marks. In one trial it is" in causes["resends"].text
    assert causes["resends"].next_step == "Fix your program, then submit again."


@pytest.mark.long
@pytest.mark.parametrize(
    ("replacements", "criterion", "text"),
    [
        (
            {"responder": ("Python saw >>", "Python saw >")},
            "replies",
            "With the reference's responder in place of yours, the same program gets all 4 marks: the responder loses "
            "the marks. The first answer that differs is number 1.",
        ),
        (
            {"responder": ('return f"', 'return "no" if text[-1] == "4" else f"')},
            "replies",
            "With the reference's responder in place of yours, the same program gets all 4 marks: the responder loses "
            "the marks. The first answer that differs is number 3. With the reference's answers from number 3 on, the "
            "trial passes; from number 4 on, it still fails. With one change in line 14 of responder.py, the same "
            "submission gets all 4 marks.",
        ),
        (
            {"program": ("number % 2 == 0", "number % 2 == 1")},
            "messages",
            "With the reference's program in place of yours, the same responder gets all 2 marks: the program loses "
            "the marks. With one change in line 5 of robot.py, the same submission gets all 2 marks.",
        ),
    ],
    ids=["every answer", "last answer", "program"],
)
def test_losing_half_is_named(
    runner: TrialRunner, replacements: dict[str, tuple[str, str]], criterion: str, text: str
) -> None:
    assert explained(runner, "echo-responder", **replacements)[criterion] == text


def test_halves_that_do_not_fit_together(runner: TrialRunner) -> None:
    # Each half follows a format of its own that the other half of the reference accepts too.
    causes = explained(
        runner,
        "json-queue",
        program=('last["message"]', '(last["reply"] if "reply" in last else last["message"]) + ""'),
        responder=('"message": f"Py saw: {number}"', '"message": f"Py saw: {number}", "reply": "none"'),
    )
    assert causes["says"].endswith("Your program and your responder do not fit together.")


@pytest.mark.long
def test_visible_trials_prove_nothing_for_marks_that_another_criterion_withholds(runner: TrialRunner) -> None:
    # The responder loses the marks of a criterion with hidden trials, which the criterion "finishes" needs.
    causes = explained(runner, "image-parser", responder=('{"typ": kind', '{"typ": kind.lower()'))
    assert "the responder loses the marks" in causes["dictionary"]
    assert not any("do not fit together" in text for text in causes.values())


def test_same_causes_twice_and_without_a_reference_no_parts(runner: TrialRunner) -> None:
    assignment, reference = read("echo-responder")
    submission = exchanged(reference, responder=("Python saw >>", "Python saw >"))
    graded = grade(submission, assignment, runner=runner)

    def find(given: Submission | None) -> tuple[Cause, ...]:
        engine = RerunEngine(runner, plan_run(submission, assignment), graded)
        plan = None if given is None else plan_reference(given, assignment)
        return find_causes(engine, plan, budget=Budget(runs=6))

    (first,), (second,) = find(reference), find(reference)
    assert [rerun.exchanges for rerun in first.reruns] == [rerun.exchanges for rerun in second.reruns]
    assert first.reruns[0].recordings[0].sha256 == second.reruns[0].recordings[0].sha256
    assert {type(exchange) for rerun in first.reruns for exchange in rerun.exchanges} == {GivenPart, AnswersFrom}
    assert find(None) == ()


def test_line_of_a_wrong_number_is_named_and_staff_see_the_change(runner: TrialRunner) -> None:
    assignment = find_assignment("turn-through-a-right-angle")
    reference = read_example("turn-through-a-right-angle", "reference")
    assert reference.program is not None
    number = next(each for each in SourceTree(reference.program.text).numbers if each.value == 1.6)
    text = f"{reference.program.text[: number.start]}2.4{reference.program.text[number.end :]}"
    submission = replace(reference, program=SourceFile("robot.py", text))
    graded = grade(submission, assignment, runner=runner)
    graded = add_causes(graded, submission, assignment, runner, budget=Budget(cpu_seconds=1e9))
    (cause, *_) = graded.causes
    assert cause.text.startswith(f"With one change in line {number.line} of robot.py, the same submission gets")
    assert cause.text.endswith(f"The turn at line {number.line} of robot.py is too long.")
    assert cause.next_step == f"Check line {number.line} of robot.py, then submit again."
    assert cause.staff_note.startswith(f"For staff: in line {number.line}, 2.4 became 1.6")


def test_parts_of_the_student() -> None:
    assert list_student_parts(find_assignment("echo-responder")) == ("program", "responder")
    assert list_student_parts(find_assignment("relay-a-message")) == ("program", "responder", "second program")
    assert list_student_parts(find_assignment("parser-agent-and-logger")) == ("responder", "agent", "logger", "parser")
    assert list_student_parts(find_assignment("say-tm129")) == ("program",)


def test_a_program_that_sleeps_uses_up_the_budget(runner: TrialRunner) -> None:
    assignment, reference = read("echo-responder")
    assert reference.program is not None
    text = f"import select\nselect.select([], [], [], 1.5)\n{reference.program.text}"
    submission = replace(reference, program=SourceFile("robot.py", text))
    graded = grade(submission, assignment, runner=runner)
    engine = RerunEngine(runner, plan_run(submission, assignment), graded, budget=Budget(sleep_seconds=0.3))
    with pytest.raises(BudgetSpent):
        engine.rerun((0,), ())
    assert engine.spent.cpu_seconds < Budget().cpu_seconds
