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
from submissions.batch_folder import read_batch_for
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


def submit(asked: BatchToSubmit) -> int:
    """Queue submissions, print which services grade them, and return the number of rejected submissions."""
    with open_installation() as (service, actor):
        done = _queue_submissions(service, actor, asked)
        if done.batch is not None:
            print_note(_describe_workers(list_workers(service, actor)))
    print_json(**_submitted_to_json(done))
    return len(done.refusals)


def _describe_workers(lively: Sequence[WorkerDescription]) -> str:
    if not lively:
        return "no worker is running; start one with robomark worker or robomark up"
    slots = sum(worker.concurrency for worker in lively)
    many = f"{len(lively)} workers grade" if len(lively) > 1 else "1 worker grades"
    return f"{many} them, concurrency {slots}"


def submit_and_grade(
    services: GradingServices, service: Service, actor: Actor, asked: BatchToSubmit, output: Path | None
) -> int:
    """Queue submissions, wait until the services have graded them, and show the marks.

    Args:
        services: The services that grade.
        service: The installation.
        actor: The user who submits.
        asked: The command's options. With ``again``, known submissions are graded again. Otherwise their grades are
            shown.
        output: Folder for the reports, or None.

    Returns:
        The number of rejected submissions.

    Raises:
        UsageError: No submission was accepted.
        HostError: A submission could not be graded.
        Cancelled: A job was cancelled meanwhile.
    """
    done = _queue_submissions(replace(service, notifier=NullNotifier()), actor, asked)
    own = [] if done.batch is None else [done.batch.id]
    batch_ids = [*own, *(known.batch_id for known in done.known if known.batch_id)]
    try:
        batch = services.notify_workers(service, actor, batch_ids, done.queued)
        lines, statistics, page = _show_results(service, actor, batch, done, asked.path.name, output)
    except KeyboardInterrupt:
        where = f"status {done.batch.id}" if done.batch else "list"
        raise Cancelled(f"stopped; ungraded submissions stay queued: robomark batch {where}") from None
    print_json(**_submitted_to_json(done), jobs=lines, statistics=statistics, report=page)
    failed = [line for line in lines if line.state is JobState.DEAD]
    if failed:
        raise HostError(f"{len(failed)} of {len(lines)} could not be graded; {failed[0].source}: {failed[0].error}")
    cancelled = [line for line in lines if line.state is JobState.CANCELLED]
    if cancelled:
        raise Cancelled(f"{len(cancelled)} of {len(lines)} not graded; {cancelled[0].source}: {cancelled[0].error}")
    return len(done.refusals)


def _queue_submissions(service: Service, actor: Actor, asked: BatchToSubmit) -> SubmittedBatch:
    """Queue the readable submissions and report how many are new."""
    course_id = operations.resolve_course(service, actor, asked.course)
    assignment = _resolve_assignment(service, actor, course_id, asked.assignment)
    checked = read_batch_for(asked.path, assignment, None if asked.people is None else read_people(asked.people))
    _show_refusals(checked.refusals)
    if not checked.grading_requests:
        raise UsageError(f"{asked.path}: none of {len(checked.refusals)} submissions can be accepted")
    done = operations.submit(service, actor, course_id, SubmitRequest(asked.path.name, checked, asked.again))
    _show_refusals(done.rejected_by_course)
    if done.known:
        known_ones = create_table("nothing new of", "why")
        for known in done.known:
            known_ones.add_row(known.student, f"already submitted as {known.job_id}{_suggest_command(known)}")
        print_renderables(known_ones)
    if done.batch is None:
        print_line("no new submissions; use --again to grade them again")
        return done
    alike = f"; {done.copied} identical to graded submissions" if done.copied else ""
    print_line(f"batch {done.batch.id}: {done.queued} queued{alike}")
    over = [job for job in done.jobs if job.staff_only]
    if over:
        for_staff = create_table("for staff only", "why")
        for job in over:
            for_staff.add_row(job.student, job.staff_only)
        print_renderables(for_staff)
    return done


def _resolve_assignment(service: Service, actor: Actor, course_id: int, name: str | None) -> Assignment | None:
    """Return the assignment from a folder on this machine, the course or the catalogue, in this order.

    Return None if no name is given.
    """
    if name is None:
        return None
    if Path(name).exists() and name not in list_catalogue_ids():
        return find_assignment(name)
    return operations.find_batch_assignment(service, actor, course_id, name)


def _submitted_to_json(done: SubmittedBatch) -> dict[str, object]:
    """Return the JSON values for the accepted submissions."""
    return {
        "batch": None if done.batch is None else done.batch.id,
        "queued": done.queued,
        "known": done.known,
        "refusals": done.refusals,
    }


def _suggest_command(known: KnownSubmission) -> str:
    if known.state is JobState.DEAD:
        return f", failed: robomark batch retry {known.batch_id}"
    if known.other_grader and known.batch_id is not None:
        return f", by another version of the grader: robomark batch regrade {known.batch_id}"
    return ""


def _show_results(
    service: Service, actor: Actor, batch: PendingBatches, done: SubmittedBatch, name: str, output: Path | None
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
    lines = list_submitted(service, actor, done)
    print_renderables(build_marks_table(lines, done.refusals))
    batch.wait_for_plots()
    statistics = show_statistics(service, actor, lines)
    print_renderables(*build_statistics(statistics))
    page = None
    if output is not None:
        page = write_batch_reports(service.store, f"Batch {name}", lines, done.refusals, output)
        print_note(f"report: {page}")
    return lines, statistics, page


def _show_refusals(refusals: Sequence[RejectedSubmission]) -> None:
    if refusals:
        from service.commands.batch.tables import build_refusals_table

        print_renderables(build_refusals_table(refusals))
