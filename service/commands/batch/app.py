"""``robomark batch``: hands folders of submissions to the queue, waits for them, and shows what came of them.

Reading the folder is `batch_folder.py``; the grading itself is the workers'.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from service.commands.batch.awaited import marks_awaited
from service.commands.batch.control import BatchId, cancel, pause, resume, retry
from service.commands.batch.export import export
from service.commands.batch.regrade import publish, regrade
from service.commands.batch.similar import similar
from service.commands.batch.tables import (
    changes_table,
    history_table,
    marks_table,
    rank_table,
    refusals_table,
    summary,
    unjudged_words,
)
from service.queue.celery_app import make_celery
from service.queue.logs import configure_logging
from service.queue.notifier import Notifier
from service.report_files import write_batch
from service.reports.written import prepare_folder
from service.settings import Settings, load_settings
from service.store import audit, batches, intake, metrics, rankings, regrades, workers
from service.store.batches import JobLine
from service.store.engine import Store, open_store
from service.store.states import JobState, Lane
from service.store.workers import WorkerDescription
from sim.errors import Cancelled, HostError, UsageError
from submissions.batch_folder import BatchContents, read_batch
from submissions.people import Refusal, read_people

batch_app = typer.Typer(help="Grade many submissions through the queue.", no_args_is_help=True)


@batch_app.command()
def submit(
    grading_requests: Annotated[
        Path, typer.Argument(help="A folder or .zip with a submission for each student, or a .csv roster.")
    ],
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="Its id in the catalogue, or its folder.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the marks and show them.")] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write a report for each submission into this folder; waits.")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Grade again what was submitted already.")] = False,
    people: Annotated[
        Path | None,
        typer.Option(help="Who is in the course: a .csv with id, name, email; Moodle's grading worksheet is one."),
    ] = None,
) -> None:
    """Queue a submission for each student; bad ones are named and stop no other.

    Downloads of Moodle, Gradescope and nbgrader are taken as they are. A roster has the columns student (or id), file
    and, where it has them, name, email, assignment; files lie below it. A student's newest submission replaces one
    that still waits, and the same one again changes nothing.

    Exit status 0 when all were taken in (and, with --wait, graded), 2 when some were refused, 3 when some could
    not be graded.
    """
    if wait or report is not None:
        refused = submit_and_wait(grading_requests, assignment, report=report, again=again, people=people)
    else:
        refused = _submit(grading_requests, assignment, again=again, people=people)
    if refused:
        raise UsageError(f"{refused} of the submissions could not be taken in; the others were")


def _submit(grading_requests: Path, assignment: str | None, *, again: bool, people: Path | None) -> int:
    settings = load_settings()
    configure_logging(settings.log_level)
    console = Console()
    with open_store(settings) as store:
        checked = _checked(grading_requests, assignment, people, console)
        accepted = _accept(store, settings, grading_requests, checked, again=again, console=console)
        if settings.broker_url:
            _notifier(settings, store).grade(Lane.BATCH, _new(accepted))
        if accepted.batch is not None:
            with store.reading() as session:
                lively = [seen.worker for seen in workers.known_workers(session) if seen.lately]
            console.print(_who_grades(lively), highlight=False, soft_wrap=True)
    return len(checked.refusals) + len(accepted.refused)


def _who_grades(lively: Sequence[WorkerDescription]) -> str:
    if not lively:
        return "no worker runs: robomark worker starts one, and so does robomark up"
    slots = sum(worker.concurrency for worker in lively)
    many = f"{len(lively)} workers grade" if len(lively) > 1 else "1 worker grades"
    return f"{many} them, {slots} at a time"


def submit_and_wait(
    grading_requests: Path,
    assignment: str | None,
    *,
    report: Path | None,
    again: bool = True,
    people: Path | None = None,
) -> int:
    """Queue submissions, grade them with the services that run or with our own, and show the marks.

    Returns how many were refused. What was submitted already is graded ``again``, or shown as it is. Raises
    UsageError when none could be taken in, HostError when one could not be graded, Cancelled when one was
    cancelled meanwhile.
    """
    if report is not None:
        prepare_folder(report)
    settings = load_settings()
    configure_logging(settings.log_level)
    console = Console()
    with open_store(settings) as store:
        checked = _checked(grading_requests, assignment, people, console)
        accepted = _accept(store, settings, grading_requests, checked, again=again, console=console)
        refusals = (*checked.refusals, *accepted.refused)
        try:
            lines = _wait(store, settings, accepted, refusals, console)
        except KeyboardInterrupt:
            where = f"status {accepted.batch.id}" if accepted.batch else "list"
            raise Cancelled(f"stopped; what is not graded stays queued: robomark batch {where}") from None
        if report is not None:
            page = write_batch(store, f"Batch {grading_requests.name}", lines, refusals, report)
            console.print(f"report: {page}", highlight=False, soft_wrap=True)
    failed = [line for line in lines if line.state is JobState.DEAD]
    if failed:
        raise HostError(f"{len(failed)} of {len(lines)} could not be graded; {failed[0].source}: {failed[0].error}")
    cancelled = [line for line in lines if line.state is JobState.CANCELLED]
    if cancelled:
        raise Cancelled(f"{len(cancelled)} of {len(lines)} not graded; {cancelled[0].source}: {cancelled[0].error}")
    return len(refusals)


@batch_app.command("list")
def list_batches() -> None:
    """The newest batches."""
    settings = load_settings()
    with open_store(settings) as store, store.reading() as session:
        lines = batches.list_batches(session)
    table = Table("batch", "name", "taken in", "submissions", "refused", "state", box=None, pad_edge=False)
    for line in lines:
        when = line.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        row = (line.id, line.name, when, str(line.jobs), str(len(line.refusals)), summary(line))
        table.add_row(*map(Text, row))
    Console().print(table)


@batch_app.command()
def status(batch: BatchId) -> None:
    """How far a batch is, and the marks that are there."""
    settings = load_settings()
    with open_store(settings) as store, store.reading() as session:
        line = batches.batch(session, batches.find_batch(session, batch))
        lines = batches.job_lines(session, line.id)
        ranks = rankings.rank_tables(session, lines)
        changes = [] if line.regrade_of is None else regrades.changes(session, line.id)
        waiting = 0 if line.regrade_of is not None else regrades.unpublished_regrades(session, line.id)
        history = audit.entries(session, "batch", line.id)
        pace = metrics.pace(session, line.id)
    console = Console()
    console.print(Text(f"batch {line.id}: {line.name}: {summary(line)}"))
    if pace is not None:
        console.print(f"{pace.per_minute:.0f} a minute, {pace.left} left", highlight=False)
    console.print(marks_table(lines, line.refusals) if line.regrade_of is None else changes_table(changes))
    for table in ranks:
        console.print(rank_table(table))
    if unjudged := unjudged_words(lines):
        console.print(Text(unjudged))
    if waiting:
        console.print(f"{waiting} regrades are done and not published: robomark batch publish {line.id}")
    if history:
        console.print(history_table(history))


batch_app.command()(export)
batch_app.command()(pause)
batch_app.command()(resume)
batch_app.command()(cancel)
batch_app.command()(retry)
batch_app.command()(regrade)
batch_app.command()(publish)
batch_app.command()(similar)


def _checked(grading_requests: Path, assignment: str | None, people: Path | None, console: Console) -> BatchContents:
    checked = read_batch(grading_requests, assignment, None if people is None else read_people(people))
    _print_refusals(checked.refusals, console)
    if not checked.grading_requests:
        raise UsageError(f"{grading_requests}: none of {len(checked.refusals)} submissions can be taken in")
    return checked


def _accept(
    store: Store, settings: Settings, path: Path, checked: BatchContents, *, again: bool, console: Console
) -> intake.AcceptedNew:
    """Take in what passed, and say what was new of it."""
    batch = (path.name, checked.grading_requests, checked.refusals)
    if again:
        made = intake.accept_batch(store, *batch, max_attempts=settings.max_attempts)
        accepted = intake.AcceptedNew(made, (), made.refused)
    else:
        accepted = intake.accept_new(store, *batch, max_attempts=settings.max_attempts)
    _print_refusals(accepted.refused, console)
    if accepted.known:
        table = Table("nothing new of", "why", box=None, pad_edge=False)
        for known in accepted.known:
            table.add_row(Text(known.student), Text(f"already submitted as {known.job_id}{_hint(known)}"))
        console.print(table)
    if accepted.batch is None and not accepted.known:
        raise UsageError(f"{path}: none of {len(checked.grading_requests)} submissions can be taken in")
    if accepted.batch is None:
        console.print("nothing new; --again grades it again", highlight=False)
    else:
        copied = sum(job.copied_from is not None for job in accepted.batch.jobs)
        alike = f"; {copied} identical to a graded one, and so graded already" if copied else ""
        console.print(f"batch {accepted.batch.id}: {_new(accepted)} queued{alike}", highlight=False)
        over = [job for job in accepted.batch.jobs if job.staff_only]
        if over:
            table = Table("for staff only", "why", box=None, pad_edge=False)
            for job in over:
                table.add_row(Text(job.student), Text(job.staff_only))
            console.print(table)
    return accepted


def _hint(known: intake.AlreadySubmitted) -> str:
    if known.state is JobState.DEAD:
        return f", dead: robomark batch retry {known.batch_id}"
    if known.other_grader and known.batch_id is not None:
        return f", by another version of the grader: robomark batch regrade {known.batch_id}"
    return ""


def _new(accepted: intake.AcceptedNew) -> int:
    return 0 if accepted.batch is None else sum(job.copied_from is None for job in accepted.batch.jobs)


def _wait(
    store: Store,
    settings: Settings,
    accepted: intake.AcceptedNew,
    refusals: Sequence[Refusal],
    console: Console,
) -> list[JobLine]:
    """Wait for the marks of what was new and of what was known, show them, and wait for the plots."""
    own = [] if accepted.batch is None else [accepted.batch.id]
    batch_ids = [*own, *(known.batch_id for known in accepted.known if known.batch_id)]
    with marks_awaited(store, settings, batch_ids, _new(accepted), console):
        lines = _lines(store, accepted)
        console.print(marks_table(lines, refusals))
    return lines


def _lines(store: Store, accepted: intake.AcceptedNew) -> list[JobLine]:
    with store.reading() as session:
        lines = [batches.job_line(session, known.job_id) for known in accepted.known]
        if accepted.batch is not None:
            lines += batches.job_lines(session, accepted.batch.id)
    return sorted(lines, key=lambda line: (line.student, line.id))


def _notifier(settings: Settings, store: Store) -> Notifier:
    return Notifier(make_celery(settings), store, settings)


def _print_refusals(refusals: Sequence[Refusal], console: Console) -> None:
    if refusals:
        console.print(refusals_table(refusals))
