"""``robomark worker``, ``doctor`` and ``show``: running the service and looking into it."""

from __future__ import annotations

import sys
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
from service.settings import load_settings
from service.store import batches, results
from service.store.batches import JobLine
from service.store.engine import open_store
from service.store.states import JobState
from sim.errors import HostError


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


def _not_graded(line: JobLine) -> str:
    reason = f": {line.error}" if line.error else ""
    return f"{line.id}: {line.source} of {line.student}, {line.assignment}: {line.state.value}{reason}\n"
