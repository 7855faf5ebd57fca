"""Hands submissions to the queue, says what was taken in and what was not, and waits for marks.

Reading the folder is ``batch_folder.py``'s; the grading itself is the workers'.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from service.commands.batch.awaited import AwaitedBatches, Services
from service.commands.shown import document, note, show, table, tell
from service.queue.logs import configure_logging
from service.settings import Settings, load_settings
from service.store.batches import batches, intake
from service.store.batches.batches import JobLine
from service.store.engine import Store, open_store
from service.store.people.students import DEFAULT_COURSE
from service.store.queue import workers
from service.store.queue.workers import WorkerDescription
from service.store.states import JobState, Lane
from sim.errors import Cancelled, HostError, UsageError
from submissions.batch_folder import BatchContents, read_batch
from submissions.people import Refusal, read_people

if TYPE_CHECKING:
    from service.grading.statistics import AssignmentStatistics


def submit(
    grading_requests: Path, assignment: str | None, *, again: bool, people: Path | None, course: str | None
) -> int:
    """Queue submissions, say who grades them, and return how many were refused."""
    settings = load_settings()
    configure_logging(settings.log_level)
    with open_store(settings) as store:
        checked = _checked(grading_requests, assignment, people)
        accepted = _accept(store, settings, grading_requests, checked, again=again, course=course)
        if settings.broker_url:
            from service.queue.celery_app import make_celery
            from service.queue.notifier import Notifier

            Notifier(make_celery(settings), store, settings).grade(Lane.BATCH, _new(accepted))
        if accepted.batch is not None:
            with store.reading() as session:
                note(_who_grades([seen.worker for seen in workers.known_workers(session) if seen.lately]))
    refusals = (*checked.refusals, *accepted.refused)
    document(**_accepted_keys(accepted, refusals))
    return len(refusals)


def _who_grades(lively: Sequence[WorkerDescription]) -> str:
    if not lively:
        return "no worker runs: robomark worker starts one, and so does robomark up"
    slots = sum(worker.concurrency for worker in lively)
    many = f"{len(lively)} workers grade" if len(lively) > 1 else "1 worker grades"
    return f"{many} them, {slots} at a time"


def submit_to(
    services: Services,
    store: Store,
    grading_requests: Path,
    assignment: str | None,
    *,
    output: Path | None,
    again: bool,
    people: Path | None,
    course: str | None,
) -> int:
    """Queue submissions, have the services grade them, and show the marks.

    Returns how many were refused. What was submitted already is graded ``again``, or shown as it is. Raises
    UsageError when none could be taken in, HostError when one could not be graded, Cancelled when one was
    cancelled meanwhile.
    """
    checked = _checked(grading_requests, assignment, people)
    accepted = _accept(store, services.settings, grading_requests, checked, again=again, course=course)
    refusals = (*checked.refusals, *accepted.refused)
    own = [] if accepted.batch is None else [accepted.batch.id]
    batch_ids = [*own, *(known.batch_id for known in accepted.known if known.batch_id)]
    try:
        batch = services.awaited(store, batch_ids, _new(accepted))
        lines, statistics, page = _shown(store, batch, accepted, refusals, grading_requests.name, output)
    except KeyboardInterrupt:
        where = f"status {accepted.batch.id}" if accepted.batch else "list"
        raise Cancelled(f"stopped; what is not graded stays queued: robomark batch {where}") from None
    document(**_accepted_keys(accepted, refusals), jobs=lines, statistics=statistics, report=page)
    failed = [line for line in lines if line.state is JobState.DEAD]
    if failed:
        raise HostError(f"{len(failed)} of {len(lines)} could not be graded; {failed[0].source}: {failed[0].error}")
    cancelled = [line for line in lines if line.state is JobState.CANCELLED]
    if cancelled:
        raise Cancelled(f"{len(cancelled)} of {len(lines)} not graded; {cancelled[0].source}: {cancelled[0].error}")
    return len(refusals)


def _checked(grading_requests: Path, assignment: str | None, people: Path | None) -> BatchContents:
    checked = read_batch(grading_requests, assignment, None if people is None else read_people(people))
    _show_refusals(checked.refusals)
    if not checked.grading_requests:
        raise UsageError(f"{grading_requests}: none of {len(checked.refusals)} submissions can be taken in")
    return checked


def _accept(
    store: Store, settings: Settings, path: Path, checked: BatchContents, *, again: bool, course: str | None
) -> intake.AcceptedNew:
    """Take in what passed, and say what was new of it."""
    batch = (path.name, checked.grading_requests, checked.refusals)
    course, most = course or DEFAULT_COURSE, settings.max_attempts
    if again:
        made = intake.accept_batch(store, *batch, course=course, max_attempts=most)
        accepted = intake.AcceptedNew(made, (), made.refused)
    else:
        accepted = intake.accept_new(store, *batch, course=course, max_attempts=most)
    _show_refusals(accepted.refused)
    if accepted.known:
        known_ones = table("nothing new of", "why")
        for known in accepted.known:
            known_ones.add_row(known.student, f"already submitted as {known.job_id}{_hint(known)}")
        show(known_ones)
    if accepted.batch is None and not accepted.known:
        raise UsageError(f"{path}: none of {len(checked.grading_requests)} submissions can be taken in")
    if accepted.batch is None:
        tell("nothing new; --again grades it again")
    else:
        copied = sum(job.copied_from is not None for job in accepted.batch.jobs)
        alike = f"; {copied} identical to a graded one, and so graded already" if copied else ""
        tell(f"batch {accepted.batch.id}: {_new(accepted)} queued{alike}")
        over = [job for job in accepted.batch.jobs if job.staff_only]
        if over:
            for_staff = table("for staff only", "why")
            for job in over:
                for_staff.add_row(job.student, job.staff_only)
            show(for_staff)
    return accepted


def _accepted_keys(accepted: intake.AcceptedNew, refusals: Sequence[Refusal]) -> dict[str, object]:
    """What a document says of what was taken in."""
    return {
        "batch": None if accepted.batch is None else accepted.batch.id,
        "queued": _new(accepted),
        "known": accepted.known,
        "refusals": refusals,
    }


def _hint(known: intake.AlreadySubmitted) -> str:
    if known.state is JobState.DEAD:
        return f", dead: robomark batch retry {known.batch_id}"
    if known.other_grader and known.batch_id is not None:
        return f", by another version of the grader: robomark batch regrade {known.batch_id}"
    return ""


def _new(accepted: intake.AcceptedNew) -> int:
    return 0 if accepted.batch is None else sum(job.copied_from is None for job in accepted.batch.jobs)


def _shown(
    store: Store,
    batch: AwaitedBatches,
    accepted: intake.AcceptedNew,
    refusals: Sequence[Refusal],
    name: str,
    output: Path | None,
) -> tuple[list[JobLine], tuple[AssignmentStatistics, ...], Path | None]:
    """Show the marks of what was new and of what was known when they are there, and write their reports."""
    # Whoever grades starts meanwhile.
    from service.commands.batch.tables import marks_table
    from service.commands.statistics_shown import statistics_parts
    from service.grading.statistics import statistics_of
    from service.report_files import write_batch
    from service.reports import html
    from service.store.grades.marked import marked

    if output is not None:
        html.prepare()
    batch.for_marks()
    lines = _lines(store, accepted)
    show(marks_table(lines, refusals))
    batch.for_plots()
    with store.reading() as session:
        statistics = statistics_of(marked(session, lines))
    show(*statistics_parts(statistics))
    page = None
    if output is not None:
        page = write_batch(store, f"Batch {name}", lines, refusals, output)
        note(f"report: {page}")
    return lines, statistics, page


def _lines(store: Store, accepted: intake.AcceptedNew) -> list[JobLine]:
    with store.reading() as session:
        lines = [batches.job_line(session, known.job_id) for known in accepted.known]
        if accepted.batch is not None:
            lines += batches.job_lines(session, accepted.batch.id)
    return sorted(lines, key=lambda line: (line.student, line.id))


def _show_refusals(refusals: Sequence[Refusal]) -> None:
    if refusals:
        from service.commands.batch.tables import refusals_table

        show(refusals_table(refusals))
