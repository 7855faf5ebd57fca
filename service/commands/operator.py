"""``robomark worker``, ``doctor``, ``show`` and ``db``: running the service and looking into it."""

from __future__ import annotations

import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from responders.sandbox import control_group
from service.commands.batch.tables import remarks
from service.commands.grade import warn_of_no_sandbox
from service.doctor import examine
from service.home import for_the_user
from service.queue.broker import EmbeddedBroker
from service.queue.worker import run_worker
from service.report_files import write_report
from service.reports.formats.text import plain_text
from service.reports.view import staff_view
from service.reports.written import file_stem
from service.settings import Settings, load_settings
from service.store import batches, results
from service.store.batches import JobLine
from service.store.engine import open_engine, open_store
from service.store.migrate import current_revision, newest_revision
from service.store.states import JobState
from sim.errors import HostError, UsageError

database_app = typer.Typer(help="Look after the database.", no_args_is_help=True)


def worker(
    unsafe: Annotated[
        bool, typer.Option("--unsafe-no-sandbox", help="Let submissions do anything on this machine; for development.")
    ] = False,
) -> None:
    """Grade what is queued until told to stop; starts the bundled broker if no other is named and none runs."""
    settings = load_settings()
    if unsafe:
        warn_of_no_sandbox()
    if settings.broker_url:
        status = run_worker(settings, unsafe=unsafe)
    else:
        # Before the broker is in this group: it can only be divided when nobody is left in it.
        control_group.divide()
        with EmbeddedBroker(settings) as broker:
            status = run_worker(broker.settings, unsafe=unsafe)
    if status:
        raise HostError(f"the worker ended with status {status}; its log says why")


def doctor() -> None:
    """Look at everything that grading needs on this machine; exit status 3 if something is wrong."""
    findings = examine(load_settings())
    table = Table(box=None, pad_edge=False, show_header=False)
    for finding in findings:
        mark = Text("ok", style="green") if finding.well else Text("wrong", style="red")
        table.add_row(mark, Text(finding.what), Text(finding.sentence, overflow="fold"))
    Console().print(table)
    wrong = [finding.what for finding in findings if not finding.well]
    if wrong:
        raise HostError(f"not well: {', '.join(wrong)}")


def show(
    grade: Annotated[str, typer.Argument(help="The grade's id, or the beginning of it.")],
    report: Annotated[
        Path | None, typer.Option(help="Write the report, and the plots as files, into this folder.")
    ] = None,
) -> None:
    """A grade that is stored: its marks and what they rest on."""
    settings = load_settings()
    with open_store(settings) as store:
        with store.reading() as session:
            line = batches.job_line(session, batches.find_job(session, grade))
            if line.state is not JobState.DONE:
                sys.stdout.write(_not_graded(line))
                return
            graded = results.load(session, line.id)
        sys.stdout.write(plain_text(staff_view(graded)))
        by = f"graded by {line.worker}" if line.copied_from is None else "not run"
        print("; ".join([f"plots: {line.plots.value}", by, f"the student's attempt {line.attempt}", *remarks(line)]))
        if report is None:
            return
        written = write_report(store, line, graded, report, file_stem(line.student))
        print(f"report: {written.path}")
        for name, data in written.plots.items():
            path = report / f"{line.id}-plot-{name}.png"
            with for_the_user():
                path.write_bytes(data)
            print(f"plot: {path}")


@database_app.command()
def upgrade() -> None:
    """Bring the tables up to this release; every command does it when it starts."""
    settings = load_settings()
    open_store(settings).close()
    print(f"the database is at revision {newest_revision()}")


@database_app.command()
def backup(file: Annotated[Path, typer.Argument(help="The copy to make; it must not exist.")]) -> None:
    """Copy the SQLite database while it is in use; the copy is whole, can be opened as it is, and is for you alone."""
    settings = load_settings()
    source = _sqlite_file(settings)
    if file.exists():
        raise UsageError(f"{file} exists already; name a new file")
    if not source.exists():
        raise UsageError(f"there is no database yet at {source}")
    try:
        with closing(sqlite3.connect(source)) as live, closing(sqlite3.connect(file)) as copy:
            live.backup(copy)
    except sqlite3.Error as error:
        file.unlink(missing_ok=True)
        raise HostError(f"the database cannot be copied to {file}: {error}") from None
    engine = open_engine(f"sqlite:///{file.absolute()}")
    try:
        print(f"{file}: {file.stat().st_size} bytes, revision {current_revision(engine)}")
    finally:
        engine.dispose()


def _sqlite_file(settings: Settings) -> Path:
    url = open_engine(settings.database).url
    if url.get_backend_name() != "sqlite" or not url.database:
        raise UsageError("only a SQLite database is copied by this command; for PostgreSQL use pg_dump")
    return Path(url.database)


def _not_graded(line: JobLine) -> str:
    reason = f": {line.error}" if line.error else ""
    return f"{line.id}: {line.source} of {line.student}, {line.assignment}: {line.state.value}{reason}\n"
