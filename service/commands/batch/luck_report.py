"""The luck report of a batch for staff, from reruns of its stored submissions on this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_renderables
from service.grading.reruns.luck import (
    CriterionLuck,
    GradedSubmission,
    LuckOptions,
    LuckReport,
    StreamLuck,
    choose_spread,
    measure_luck,
)
from service.grading.trial_runner import TrialRunner
from service.operations import batch_views, batches, stored_grades
from service.operations.context import Actor, Service
from service.operations.stored_grades import JobLine
from service.operations.types import JobState
from service.reports.display_text import format_decimal, to_one_line
from submissions.seeds import choose_secret

if TYPE_CHECKING:
    from rich.table import Table


def report_luck(batch: str, submission_count: int, draws: int, cpu_seconds: float) -> None:
    """Print how much of the marks of a batch is luck, for each assignment.

    Args:
        batch: Batch id, or the beginning of it.
        submission_count: How many submissions of each assignment to run again.
        draws: How many other draws of each random stream.
        cpu_seconds: CPU time for all reruns.

    Raises:
        UsageError: There is no such batch.
        HostError: The machine failed.
    """
    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        view = batch_views.show_graded(service, actor, stored_batch.course_id, stored_batch.id)
        lines = [each for each in view.lines if each.state is JobState.DONE and each.marks is not None]
        reports = list(_measure(service, actor, lines, submission_count, LuckOptions(draws, cpu_seconds)))
    print_json(batch=stored_batch.id, assignments=[{"graded": graded, "luck": report} for graded, report in reports])
    for graded, report in reports:
        _print_report(graded, report)
    if not reports:
        print_line(f"batch {stored_batch.id} has no graded submissions")


def _measure(
    service: Service, actor: Actor, lines: list[JobLine], submission_count: int, options: LuckOptions
) -> Iterator[tuple[int, LuckReport]]:
    """Yield the number of graded submissions and the report of each assignment. They share the CPU time."""
    assignments = sorted({line.assignment for line in lines})
    options = LuckOptions(options.draws, options.cpu_seconds / max(len(assignments), 1))
    with TrialRunner() as runner:
        for assignment in assignments:
            own_lines = sorted(
                (line for line in lines if line.assignment == assignment), key=lambda line: (line.marks, line.id)
            )
            chosen = choose_spread([line.id for line in own_lines], submission_count)
            loaders: list[Callable[[], GradedSubmission | None]] = [
                partial(_load, service, actor, job_id) for job_id in chosen
            ]
            newest = max(own_lines, key=lambda line: (line.queued_at, line.id))
            definition = stored_grades.load_grading(service, actor, newest.id).request.assignment
            yield len(own_lines), measure_luck(definition, loaders, runner, options)


def _load(service: Service, actor: Actor, job_id: str) -> GradedSubmission | None:
    """Load a grade with its input; None if this installation cannot repeat it."""
    grading = stored_grades.load_grading(service, actor, job_id)
    grade, request = grading.grade, grading.request
    secret = choose_secret(grade.secret_sha256, grading.own_secret)
    if secret is None:
        return None
    is_same = (grade.submission, grade.assignment_version) == (request.submission.sha256, request.assignment.version)
    known_trials = {(each.scenario.id, each.index) for each in request.assignment.trials(secret)}
    has_own_trials = {(each.scenario, each.index) for each in grade.trials} <= known_trials
    # Grades of trained models have trials that are not those of a robot.
    if not is_same or not has_own_trials or not grade.trials or request.assignment.training is not None:
        return None
    return GradedSubmission(grade, request.submission, request.assignment, secret)


def _print_report(graded: int, report: LuckReport) -> None:
    print_line(
        f"{report.assignment}: {report.submissions} of {graded} graded submissions, {report.draws} other draws of each "
        "random stream in total"
    )
    if report.total is not None:
        print_renderables(_build_table(report, report.total))
    elif report.submissions:
        print_line("chance plays no part: no noise, no jitter of the start pose, no random channel")
    print_line(_describe_omissions(graded, report))


def _build_table(report: LuckReport, total: CriterionLuck) -> Table:
    table = create_table(
        "criterion", "marks", "deviation", *report.streams, right=("marks", "deviation", *report.streams)
    )
    for criterion in (*report.criteria, total):
        table.add_row(
            to_one_line(criterion.title),
            format_decimal(criterion.max_marks),
            f"{criterion.deviation:.2f}",
            *map(_format_stream, criterion.streams),
        )
    return table


def _format_stream(stream: StreamLuck) -> str:
    return "-" if stream.share is None else f"{stream.share:.0%} ({stream.deviation:.2f})"


def _describe_omissions(graded: int, report: LuckReport) -> str:
    unmeasured = graded - report.submissions - report.unrepeatable
    parts = [f"{unmeasured} not run again"] if unmeasured else []
    if report.unrepeatable:
        parts.append(f"{report.unrepeatable} that cannot be run again here")
    if report.draws < report.planned_draws:
        parts.append(f"{report.planned_draws - report.draws} of {report.planned_draws} draws: the CPU time was spent")
    spent = f"{report.cpu_seconds:.0f} CPU seconds"
    return f"{spent}; left out of {graded} submissions: {', '.join(parts)}" if parts else f"{spent}; nothing left out"
