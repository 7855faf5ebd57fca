"""Adds the causes of lost marks to a grade, by running its trials again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from service.grading.grade import Grade
from service.grading.reruns.cause_sentences import build_shown_causes
from service.grading.reruns.causes import Cause, find_causes
from service.grading.reruns.engine import DEFAULT_BUDGET, Budget, RerunEngine
from service.grading.reruns.halves import plan_reference
from service.grading.run_plan import RunPlan, plan_run
from service.grading.trial_runner import TrialRunner
from submissions.assignment.definition import Assignment
from submissions.seeds import PUBLIC_SECRET, SeedSource
from submissions.submission import Submission

_VISIBLE = frozenset({"visible"})


def add_causes(
    grade: Grade,
    submission: Submission,
    assignment: Assignment,
    runner: TrialRunner,
    *,
    reference: Submission | None = None,
    secret: SeedSource = PUBLIC_SECRET,
    reveals: int = 0,
    revealed_before: int = 0,
    budget: Budget = DEFAULT_BUDGET,
    heartbeat: Callable[[], None] = lambda: None,
) -> Grade:
    """Return the grade with the causes of its lost marks; without them if the assignment wants none.

    Args:
        grade: The grade of ``submission``, by ``assignment`` and ``secret``.
        submission: The submission.
        assignment: The assignment.
        runner: Runs the trials.
        reference: The reference solution, if there is one. It is used only if the assignment says so.
        secret: Where the seeds of the grade come from.
        reveals: How many causes in hidden trials the student may see. Staff see all.
        revealed_before: How many of them are in other grades.
        budget: What the search for each criterion may cost.
        heartbeat: Called several times a second. It may raise an exception to stop the search.

    Raises:
        UsageError: The grade is not of this submission and assignment.
        HostError: The machine failed.
    """
    plan = plan_run(submission, assignment, secret)
    has_lost_marks = grade.trials and grade.marks < grade.max_marks
    if not has_lost_marks or not assignment.reruns.causes or assignment.training is not None:
        return grade
    runner.start_zygotes(plan.processes)
    given_plan: RunPlan | None = None
    if reference is not None and assignment.reruns.uses_reference:
        given_plan = plan_reference(reference, assignment, secret)
    causes: list[Cause] = []
    visibilities = frozenset(trial.visibility for trial in grade.trials)
    for allowed in dict.fromkeys((_VISIBLE & visibilities, visibilities)):
        engine = RerunEngine(runner, plan, grade, secret=secret, visibilities=allowed, heartbeat=heartbeat)
        explained = {cause.criterion for cause in causes}
        causes += find_causes(engine, given_plan, budget=budget, explained=explained)
    order = {criterion.id: number for number, criterion in enumerate(assignment.criteria)}
    causes.sort(key=lambda cause: order[cause.criterion])
    return replace(grade, causes=build_shown_causes(causes, reveals, revealed_before))
