"""``robomark show``: one grade that is stored."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.words import remarks
from service.commands.shown import document, note, tell
from service.home import for_the_user
from service.settings import load_settings
from service.store import batches
from service.store.batches import JobLine
from service.store.engine import open_store
from service.store.states import JobState


def show(
    grade: Annotated[str, typer.Argument(help="The grade's id, or the beginning of it.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the report, and the plots as files, into this folder."),
    ] = None,
    replay: Annotated[
        Path | None,
        typer.Option("--replay", help="Write a page that plays its trials to this file; their data if it is a .json."),
    ] = None,
) -> None:
    """A grade that is stored: its marks and what they rest on."""
    with open_store(load_settings()) as store:
        with store.reading() as session:
            line = batches.job_line(session, batches.find_job(session, grade))
        if line.state is not JobState.DONE:
            document(job=line, grade=None)
            tell(_not_graded(line))
            return
        # A stored grade has its recordings, which take longer to load than to find that there is none.
        from service.reports.formats.json_output import json_document
        from service.reports.formats.text import plain_text
        from service.reports.view import staff_view
        from service.store import results

        with store.reading() as session:
            graded = results.load(session, line.id)
        document(job=line, grade=json_document(staff_view(graded)))
        tell(plain_text(staff_view(graded)).rstrip("\n"))
        by = f"graded by {line.worker}" if line.copied_from is None else "not run"
        tell("; ".join([f"plots: {line.plots.value}", by, f"the student's attempt {line.attempt}", *remarks(line)]))
        if replay is None and output is None:
            return
        # A page draws plots that are not there yet.
        from service.report_files import write_grade_replay, write_report
        from service.reports.written import file_stem

        if replay is not None:
            write_grade_replay(store, line, graded, replay)
            note(f"replay: {replay}")
        if output is None:
            return
        written = write_report(store, line, graded, output, file_stem(line.student))
        note(f"report: {written.path}")
        for name, data in written.plots.items():
            path = output / f"{line.id}-plot-{name}.png"
            with for_the_user():
                path.write_bytes(data)
            note(f"plot: {path}")


def _not_graded(line: JobLine) -> str:
    reason = f": {line.error}" if line.error else ""
    return f"{line.id}: {line.source} of {line.student}, {line.assignment}: {line.state.value}{reason}"
