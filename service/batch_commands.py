"""``robomark batch``: hands folders of submissions to the queue, waits for them, and shows what came of them.

Reading the folder is ``preflight.py``; the grading itself is the workers'.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from responders.sandbox.manager import Sandboxes
from service.grading.grade import Grade
from service.preflight import Preflight, preflight
from service.queue.celery_app import make_celery
from service.queue.embedded import EmbeddedServices
from service.queue.logs import configure_logging
from service.queue.nudges import Nudger
from service.report_files import write_batch
from service.reports.csv_output import marks_csv, moodle_csv
from service.reports.json_output import json_document
from service.settings import Settings, load_settings
from service.store import batches, grades, intake
from service.store.batches import BatchLine, JobLine
from service.store.engine import Store, open_store
from service.store.models import JobState, Lane
from service.waiting import Waiting
from sim.errors import Cancelled, HostError, UsageError

batch_app = typer.Typer(help="Grade many hand-ins through the queue.", no_args_is_help=True)

_STYLES: Mapping[JobState, str] = MappingProxyType(
    {JobState.DONE: "green", JobState.DEAD: "red", JobState.RUNNING: "cyan", JobState.CANCELLED: "yellow"}
)


class ExportFormat(StrEnum):
    """What ``batch export`` writes."""

    CSV = "csv"
    MOODLE = "moodle"
    JSON = "json"


BatchId = Annotated[str, typer.Argument(help="The batch's id, or the beginning of it.")]


@batch_app.command()
def submit(
    hand_ins: Annotated[Path, typer.Argument(help="A folder or .zip with a hand-in for each student.")],
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="Its id in the catalogue, or its folder.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the marks and show them.")] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write a report for each hand-in into this folder; waits.")
    ] = None,
) -> None:
    """Queue a hand-in for each student; bad ones are named and stop no other.

    Exit status 0 when all were taken in (and, with --wait, graded), 2 when some were refused, 3 when some could
    not be graded.
    """
    if wait or report is not None:
        refused = submit_and_wait(hand_ins, assignment, report=report)
    else:
        refused = _submit(hand_ins, assignment)
    if refused:
        raise UsageError(f"{refused} of the hand-ins could not be taken in; the others were")


def _submit(hand_ins: Path, assignment: str | None) -> int:
    settings = load_settings()
    configure_logging(settings.log_level)
    console = Console()
    with open_store(settings) as store:
        checked = _checked(hand_ins, assignment, console)
        accepted = _accept(store, settings, hand_ins, checked)
        if settings.broker_url:
            _nudger(settings, store).grade(Lane.BATCH, len(accepted.jobs))
    console.print(f"batch {accepted.id}: {len(accepted.jobs)} queued", highlight=False)
    if not settings.broker_url:
        console.print("A worker grades them: robomark worker", highlight=False)
    return len(checked.problems)


def submit_and_wait(hand_ins: Path, assignment: str | None, *, report: Path | None) -> int:
    """Queue hand-ins, grade them with the services that run or with our own, and show the marks.

    Returns how many were refused. Raises UsageError when none could be taken in, HostError when one could not be
    graded.
    """
    settings = load_settings()
    configure_logging(settings.log_level)
    console = Console()
    with open_store(settings) as store:
        checked = _checked(hand_ins, assignment, console)
        accepted = _accept(store, settings, hand_ins, checked)
        console.print(f"batch {accepted.id}: {len(accepted.jobs)} queued", highlight=False)
        try:
            lines = _wait(store, settings, accepted.id, len(accepted.jobs), console)
        except KeyboardInterrupt:
            raise Cancelled(f"stopped; what is not graded stays queued: robomark batch status {accepted.id}") from None
        if report is not None:
            page = write_batch(store, f"Batch {hand_ins.name}", lines, checked.problems, report)
            console.print(f"report: {page}", highlight=False, soft_wrap=True)
    failed = [line for line in lines if line.state is JobState.DEAD]
    if failed:
        raise HostError(f"{len(failed)} of {len(lines)} could not be graded; {failed[0].source}: {failed[0].error}")
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


@batch_app.command()
def export(
    batch: BatchId,
    form: Annotated[ExportFormat, typer.Option("--format", help="What to write.")] = ExportFormat.CSV,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="A file instead of the screen.")] = None,
) -> None:
    """The marks of a batch for a spreadsheet, for Moodle, or as JSON."""
    settings = load_settings()
    with open_store(settings) as store:
        with store.reading() as session:
            lines = batches.job_lines(session, batches.find_batch(session, batch))
        text = _EXPORTS[form](list(_grades(store, lines)))
    if output is None:
        sys.stdout.write(text)
        return
    try:
        output.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise UsageError(f"{output} cannot be written: {error.strerror}") from None


def _export_json(found: Sequence[Grade]) -> str:
    return json.dumps([{"student": grade.student, **json_document(grade)} for grade in found], indent=2) + "\n"


_EXPORTS: Mapping[ExportFormat, Callable[[Sequence[Grade]], str]] = MappingProxyType(
    {ExportFormat.CSV: marks_csv, ExportFormat.MOODLE: moodle_csv, ExportFormat.JSON: _export_json}
)


def _grades(store: Store, lines: Iterable[JobLine]) -> Iterable[Grade]:
    for line in lines:
        if line.state is JobState.DONE:
            with store.reading() as session:
                yield grades.load(session, line.id)


def _checked(hand_ins: Path, assignment: str | None, console: Console) -> Preflight:
    checked = preflight(hand_ins, assignment)
    _print_problems(checked.problems, console)
    if not checked.hand_ins:
        raise UsageError(f"{hand_ins}: none of {len(checked.problems)} hand-ins can be taken in")
    return checked


def _accept(store: Store, settings: Settings, path: Path, checked: Preflight) -> intake.AcceptedBatch:
    return intake.accept_batch(store, path.name, checked.hand_ins, checked.problems, max_attempts=settings.max_attempts)


def _wait(store: Store, settings: Settings, batch_id: str, count: int, console: Console) -> list[JobLine]:
    """Wait for the marks, show them, and wait for the plots."""
    with ExitStack() as services:
        if settings.broker_url:
            broker, keep_up = settings, _nothing
        else:
            with Sandboxes() as sandboxes:
                # Here the reason can be said; a worker that refuses would only be seen to end.
                sandboxes.check()
            embedded = services.enter_context(EmbeddedServices(settings, store))
            broker, keep_up = embedded.settings, embedded.ensure
        nudger = _nudger(broker, store)
        nudger.grade(Lane.BATCH, count)
        waiting = Waiting(store, nudger, batch_id, console, keep_up)
        waiting.for_marks()
        with store.reading() as session:
            lines = batches.job_lines(session, batch_id)
        console.print(_marks_table(lines))
        waiting.for_plots()
    return lines


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
    return ", ".join(parts) or "empty"


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
