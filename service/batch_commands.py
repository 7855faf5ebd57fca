"""``robomark batch``: hands folders of submissions to the queue, waits for them, and shows what came of them.

Reading the folder is ``preflight.py``; the grading itself is the workers'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from responders.sandbox.manager import Sandboxes
from service.batch_control_commands import BatchId, cancel, pause, resume, retry
from service.batch_export_command import export
from service.preflight import Preflight, preflight
from service.queue.celery_app import make_celery
from service.queue.embedded import EmbeddedServices
from service.queue.logs import configure_logging
from service.queue.nudges import Nudger
from service.report_files import write_batch
from service.reports.written import prepare_folder
from service.settings import Settings, load_settings
from service.store import batches, intake
from service.store.batches import BatchLine, JobLine
from service.store.engine import Store, open_store
from service.store.models import BatchState, JobState, Lane
from service.waiting import Waiting
from sim.errors import Cancelled, HostError, UsageError

batch_app = typer.Typer(help="Grade many hand-ins through the queue.", no_args_is_help=True)

_STYLES: Mapping[JobState, str] = MappingProxyType(
    {JobState.DONE: "green", JobState.DEAD: "red", JobState.RUNNING: "cyan", JobState.CANCELLED: "yellow"}
)


@batch_app.command()
def submit(
    hand_ins: Annotated[
        Path, typer.Argument(help="A folder or .zip with a hand-in for each student, or a .csv roster.")
    ],
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="Its id in the catalogue, or its folder.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the marks and show them.")] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write a report for each hand-in into this folder; waits.")
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Grade again what was handed in already.")] = False,
) -> None:
    """Queue a hand-in for each student; bad ones are named and stop no other.

    A roster has the columns student, file and assignment, the last not needed with -a; files lie below it. A
    student's newest hand-in replaces one that still waits, and the same one again changes nothing.

    Exit status 0 when all were taken in (and, with --wait, graded), 2 when some were refused, 3 when some could
    not be graded.
    """
    if wait or report is not None:
        refused = submit_and_wait(hand_ins, assignment, report=report, again=again)
    else:
        refused = _submit(hand_ins, assignment, again=again)
    if refused:
        raise UsageError(f"{refused} of the hand-ins could not be taken in; the others were")


def _submit(hand_ins: Path, assignment: str | None, *, again: bool) -> int:
    settings = load_settings()
    configure_logging(settings.log_level)
    console = Console()
    with open_store(settings) as store:
        checked = _checked(hand_ins, assignment, console)
        accepted = _accept(store, settings, hand_ins, checked, again=again, console=console)
        if settings.broker_url:
            _nudger(settings, store).grade(Lane.BATCH, _new(accepted))
    if accepted.batch is not None and not settings.broker_url:
        console.print("A worker grades them: robomark worker", highlight=False)
    return len(checked.problems)


def submit_and_wait(hand_ins: Path, assignment: str | None, *, report: Path | None, again: bool = True) -> int:
    """Queue hand-ins, grade them with the services that run or with our own, and show the marks.

    Returns how many were refused. What was handed in already is graded ``again``, or shown as it is. Raises
    UsageError when none could be taken in, HostError when one could not be graded, Cancelled when one was
    cancelled meanwhile.
    """
    if report is not None:
        prepare_folder(report)
    settings = load_settings()
    configure_logging(settings.log_level)
    console = Console()
    with open_store(settings) as store:
        checked = _checked(hand_ins, assignment, console)
        accepted = _accept(store, settings, hand_ins, checked, again=again, console=console)
        try:
            lines = _wait(store, settings, accepted, console)
        except KeyboardInterrupt:
            where = f"status {accepted.batch.id}" if accepted.batch else "list"
            raise Cancelled(f"stopped; what is not graded stays queued: robomark batch {where}") from None
        if report is not None:
            page = write_batch(store, f"Batch {hand_ins.name}", lines, checked.problems, report)
            console.print(f"report: {page}", highlight=False, soft_wrap=True)
    failed = [line for line in lines if line.state is JobState.DEAD]
    if failed:
        raise HostError(f"{len(failed)} of {len(lines)} could not be graded; {failed[0].source}: {failed[0].error}")
    cancelled = [line for line in lines if line.state is JobState.CANCELLED]
    if cancelled:
        raise Cancelled(f"{len(cancelled)} of {len(lines)} not graded; {cancelled[0].source}: {cancelled[0].error}")
    return len(checked.problems)


@batch_app.command("list")
def list_batches() -> None:
    """The newest batches."""
    settings = load_settings()
    with open_store(settings) as store, store.reading() as session:
        lines = batches.list_batches(session)
    table = Table("batch", "name", "taken in", "hand-ins", "refused", "state", box=None, pad_edge=False)
    for line in lines:
        when = line.created_at.astimezone().strftime("%Y-%m-%d %H:%M")
        row = (line.id, line.name, when, str(line.jobs), str(len(line.problems)), _summary(line))
        table.add_row(*map(Text, row))
    Console().print(table)


@batch_app.command()
def status(batch: BatchId) -> None:
    """How far a batch is, and the marks that are there."""
    settings = load_settings()
    with open_store(settings) as store, store.reading() as session:
        line = batches.batch(session, batches.find_batch(session, batch))
        lines = batches.job_lines(session, line.id)
    console = Console()
    console.print(Text(f"batch {line.id}: {line.name}: {_summary(line)}"))
    _print_problems(line.problems, console)
    console.print(_marks_table(lines))


batch_app.command()(export)
batch_app.command()(pause)
batch_app.command()(resume)
batch_app.command()(cancel)
batch_app.command()(retry)


def _checked(hand_ins: Path, assignment: str | None, console: Console) -> Preflight:
    checked = preflight(hand_ins, assignment)
    _print_problems(checked.problems, console)
    if not checked.hand_ins:
        raise UsageError(f"{hand_ins}: none of {len(checked.problems)} hand-ins can be taken in")
    return checked


def _accept(
    store: Store, settings: Settings, path: Path, checked: Preflight, *, again: bool, console: Console
) -> intake.AcceptedNew:
    """Take in what passed, and say what was new of it."""
    batch = (path.name, checked.hand_ins, checked.problems)
    if again:
        accepted = intake.AcceptedNew(intake.accept_batch(store, *batch, max_attempts=settings.max_attempts), ())
    else:
        accepted = intake.accept_new(store, *batch, max_attempts=settings.max_attempts)
    if accepted.known:
        table = Table("nothing new of", "why", box=None, pad_edge=False)
        for known in accepted.known:
            dead = f", dead: robomark batch retry {known.batch_id}" if known.state is JobState.DEAD else ""
            table.add_row(Text(known.student), Text(f"already handed in as {known.job_id}{dead}"))
        console.print(table)
    if accepted.batch is None:
        console.print("nothing new; --again grades it again", highlight=False)
    else:
        console.print(f"batch {accepted.batch.id}: {_new(accepted)} queued", highlight=False)
    return accepted


def _new(accepted: intake.AcceptedNew) -> int:
    return 0 if accepted.batch is None else len(accepted.batch.jobs)


def _wait(store: Store, settings: Settings, accepted: intake.AcceptedNew, console: Console) -> list[JobLine]:
    """Wait for the marks of what was new and of what was known, show them, and wait for the plots."""
    unfinished = _unfinished(store, accepted, console)
    with ExitStack() as services:
        waiting: list[Waiting] = []
        if unfinished:
            if settings.broker_url:
                broker, keep_up = settings, _nothing
            else:
                with Sandboxes() as sandboxes:
                    # Here the reason can be said; a worker that refuses would only be seen to end.
                    sandboxes.check()
                embedded = services.enter_context(EmbeddedServices(settings, store))
                broker, keep_up = embedded.settings, embedded.ensure
            nudger = _nudger(broker, store)
            nudger.grade(Lane.BATCH, _new(accepted))
            waiting = [Waiting(store, nudger, batch_id, console, keep_up) for batch_id in unfinished]
        for each in waiting:
            each.for_marks()
        lines = _lines(store, accepted)
        console.print(_marks_table(lines))
        for each in waiting:
            each.for_plots()
    return lines


def _unfinished(store: Store, accepted: intake.AcceptedNew, console: Console) -> list[str]:
    """The batches to wait for; one that is paused would keep its waiter for ever, and is only named."""
    own = [] if accepted.batch is None else [accepted.batch.id]
    unfinished = []
    with store.reading() as session:
        for batch_id in dict.fromkeys([*own, *(known.batch_id for known in accepted.known if known.batch_id)]):
            far = batches.progress(session, batch_id)
            if far.ended == far.jobs and not far.plots_due:
                continue
            if batches.batch(session, batch_id).state is BatchState.OPEN:
                unfinished.append(batch_id)
            else:
                console.print(f"batch {batch_id} is paused: robomark batch resume {batch_id}", highlight=False)
    return unfinished


def _lines(store: Store, accepted: intake.AcceptedNew) -> list[JobLine]:
    with store.reading() as session:
        lines = [batches.job_line(session, known.job_id) for known in accepted.known]
        if accepted.batch is not None:
            lines += batches.job_lines(session, accepted.batch.id)
    return sorted(lines, key=lambda line: (line.student, line.id))


def _nothing() -> None:
    """Services that are not ours are kept up by others."""


def _nudger(settings: Settings, store: Store) -> Nudger:
    return Nudger(make_celery(settings), store, settings)


def _print_problems(problems: Sequence[tuple[str, str]], console: Console) -> None:
    if not problems:
        return
    table = Table("not taken in", "why", box=None, pad_edge=False)
    for name, sentence in problems:
        table.add_row(Text(name), Text(sentence))
    console.print(table)


def _summary(line: BatchLine) -> str:
    parts = [f"{line.states[state]} {state.value}" for state in JobState if line.states.get(state)]
    held = "" if line.state is BatchState.OPEN else f"{line.state.value}: "
    return held + (", ".join(parts) or "empty")


def _marks_table(lines: Sequence[JobLine]) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("student", "assignment"):
        table.add_column(heading, overflow="fold")
    table.add_column("marks", justify="right")
    table.add_column("accuracy", justify="right")
    for heading in ("verdict", "grade"):
        table.add_column(heading)
    for line in lines:
        marks = "" if line.marks is None else f"{line.marks.normalize():f} / {line.max_marks.normalize():f}"
        accuracy = "" if line.accuracy is None else f"{line.accuracy:.2f}"
        outcome = line.verdict or (f"{line.state.value}: {line.error}" if line.error else line.state.value)
        table.add_row(
            Text(line.student),
            Text(line.assignment),
            marks,
            accuracy,
            Text(outcome, style=_STYLES.get(line.state, "")),
            line.id,
        )
    return table
