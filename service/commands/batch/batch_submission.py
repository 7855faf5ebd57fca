"""Queue submissions, report accepted and rejected ones, and wait for marks.

``batch_folder.py`` reads the folder. The workers do the grading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from service.commands.batch.grading_services import GradingServices, NullNotifier, PendingBatches
from service.commands.installation import open_installation
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.operations import batches as operations
from service.operations.batch_views import (
    JobLine,
    WorkerDescription,
    list_submitted,
    list_workers,
    show_statistics,
)
from service.operations.batches import KnownSubmission, SubmitRequest, SubmittedBatch
from service.operations.context import Actor, Service
from service.operations.types import JobState
from sim.errors import Cancelled, HostError, UsageError
from submissions.assignment.folder import list_catalogue_ids
from submissions.assignment.reader import find_assignment
from submissions.batch_folder import read_batch
from submissions.student_identity import RejectedSubmission, read_people

if TYPE_CHECKING:
    from service.grading.class_statistics import AssignmentStatistics
    from submissions.assignment.definition import Assignment


@dataclass(frozen=True, slots=True)
class BatchToSubmit:
    """The options of ``batch submit``."""

    path: Path
    assignment: str | None
    people: Path | None
    course: str | None
    again: bool


def submit(request: BatchToSubmit) -> int:
    """Queue submissions, print which services grade them, and return the number of rejected submissions."""
    with open_installation() as (service, actor):
        submitted_batch = _queue_submissions(service, actor, request)
        if submitted_batch.batch is not None:
            print_note(_describe_workers(list_workers(service, actor)))
    print_json(**_submitted_to_json(submitted_batch))
    return len(submitted_batch.refusals)


def _describe_workers(workers: Sequence[WorkerDescription]) -> str:
    if not workers:
        return "no worker is running; start one with robomark worker or robomark up"
    slots = sum(worker.concurrency for worker in workers)
    worker_text = f"{len(workers)} workers grade" if len(workers) > 1 else "1 worker grades"
    return f"{worker_text} them, concurrency {slots}"


def submit_and_grade(
    services: GradingServices, service: Service, actor: Actor, request: BatchToSubmit, output: Path | None
) -> int:
    """Queue submissions, wait until the services have graded them, and show the marks.

    Args:
        services: The services that grade.
        service: The installation.
        actor: The user who submits.
        request: The command's options. With ``again``, known submissions are graded again. Otherwise their grades are
            shown.
        output: Folder for the reports, or None.

    Returns:
        The number of rejected submissions.

    Raises:
        UsageError: No submission was accepted.
        HostError: A submission could not be graded.
        Cancelled: A job was cancelled meanwhile.
    """
    submitted_batch = _queue_submissions(replace(service, notifier=NullNotifier()), actor, request)
    new_batch_ids = [] if submitted_batch.batch is None else [submitted_batch.batch.id]
    batch_ids = [*new_batch_ids, *(known.batch_id for known in submitted_batch.known if known.batch_id)]
    try:
        batch = services.notify_workers(service, actor, batch_ids, submitted_batch.queued)
        lines, statistics, page = _show_results(service, actor, batch, submitted_batch, request.path.name, output)
    except KeyboardInterrupt:
        command = f"status {submitted_batch.batch.id}" if submitted_batch.batch else "list"
        raise Cancelled(f"stopped; ungraded submissions stay queued: robomark batch {command}") from None
    print_json(**_submitted_to_json(submitted_batch), jobs=lines, statistics=statistics, report=page)
    failed_lines = [line for line in lines if line.state is JobState.DEAD]
    if failed_lines:
        raise HostError(
            f"{len(failed_lines)} of {len(lines)} could not be graded; {failed_lines[0].source}: "
            f"{failed_lines[0].error}"
        )
    cancelled_lines = [line for line in lines if line.state is JobState.CANCELLED]
    if cancelled_lines:
        raise Cancelled(
            f"{len(cancelled_lines)} of {len(lines)} not graded; {cancelled_lines[0].source}: "
            f"{cancelled_lines[0].error}"
        )
    return len(submitted_batch.refusals)


def _queue_submissions(service: Service, actor: Actor, request: BatchToSubmit) -> SubmittedBatch:
    """Queue the readable submissions and report how many are new."""
    course_id = operations.resolve_course(service, actor, request.course)
    assignment = _resolve_assignment(service, actor, course_id, request.assignment)
    batch_contents = read_batch(
        request.path, assignment, None if request.people is None else read_people(request.people)
    )
    _show_refusals(batch_contents.refusals)
    if not batch_contents.grading_requests:
        raise UsageError(f"{request.path}: none of {len(batch_contents.refusals)} submissions can be accepted")
    submitted_batch = operations.submit(
        service, actor, course_id, SubmitRequest(request.path.name, batch_contents, request.again)
    )
    _show_refusals(submitted_batch.rejected_by_course)
    if submitted_batch.known:
        known_table = create_table("nothing new of", "why")
        for known_submission in submitted_batch.known:
            known_table.add_row(
                known_submission.student,
                f"already submitted as {known_submission.job_id}{_suggest_command(known_submission)}",
            )
        print_renderables(known_table)
    if submitted_batch.batch is None:
        print_line("no new submissions; use --again to grade them again")
        return submitted_batch
    copied_text = f"; {submitted_batch.copied} identical to graded submissions" if submitted_batch.copied else ""
    print_line(f"batch {submitted_batch.batch.id}: {submitted_batch.queued} queued{copied_text}")
    staff_only_jobs = [job for job in submitted_batch.jobs if job.staff_only]
    if staff_only_jobs:
        staff_table = create_table("for staff only", "why")
        for job in staff_only_jobs:
            staff_table.add_row(job.student, job.staff_only)
        print_renderables(staff_table)
    return submitted_batch


def _resolve_assignment(service: Service, actor: Actor, course_id: int, name: str | None) -> Assignment | None:
    """Return the assignment from a folder on this machine, the course or the catalogue, in this order.

    Return None if no name is given.
    """
    if name is None:
        return None
    if Path(name).exists() and name not in list_catalogue_ids():
        return find_assignment(name)
    return operations.find_batch_assignment(service, actor, course_id, name)


def _submitted_to_json(submitted_batch: SubmittedBatch) -> dict[str, object]:
    """Return the JSON values for the accepted submissions."""
    return {
        "batch": None if submitted_batch.batch is None else submitted_batch.batch.id,
        "queued": submitted_batch.queued,
        "known": submitted_batch.known,
        "refusals": submitted_batch.refusals,
    }


def _suggest_command(known_submission: KnownSubmission) -> str:
    if known_submission.state is JobState.DEAD:
        return f", failed: robomark batch retry {known_submission.batch_id}"
    if known_submission.other_grader and known_submission.batch_id is not None:
        return f", by another version of the grader: robomark batch regrade {known_submission.batch_id}"
    return ""


def _show_results(
    service: Service,
    actor: Actor,
    batch: PendingBatches,
    submitted_batch: SubmittedBatch,
    name: str,
    output: Path | None,
) -> tuple[list[JobLine], tuple[AssignmentStatistics, ...], Path | None]:
    """Wait for the marks, show those of new and known submissions, and write the reports."""
    # The services start during these imports.
    from service.commands.batch.tables import build_marks_table
    from service.commands.statistics_tables import build_statistics
    from service.report_files import write_batch_reports
    from service.reports import html

    if output is not None:
        html.preload_templates()
    batch.wait_for_marks()
    lines = list_submitted(service, actor, submitted_batch)
    print_renderables(build_marks_table(lines, submitted_batch.refusals))
    batch.wait_for_plots()
    statistics = show_statistics(service, actor, lines)
    print_renderables(*build_statistics(statistics))
    page = None
    if output is not None:
        page = write_batch_reports(service.store, f"Batch {name}", lines, submitted_batch.refusals, output)
        print_note(f"report: {page}")
    return lines, statistics, page


def _show_refusals(refusals: Sequence[RejectedSubmission]) -> None:
    if refusals:
        from service.commands.batch.tables import build_refusals_table

        print_renderables(build_refusals_table(refusals))
