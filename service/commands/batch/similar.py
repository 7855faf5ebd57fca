"""``robomark batch similar``: whose submissions are alike, for staff to look at.

What is alike is decided in ``service.similarity``; marks neither come from it nor change by it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from service.commands.batch.control import BatchId
from service.reports.similarity import as_json, similarity_page, similarity_rows, what_it_says
from service.reports.view import SimilarityView, staff_similarity
from service.reports.written import prepare_folder, write_page
from service.settings import load_settings
from service.similarity.sources import sources_of
from service.store import batches, intake
from service.store.batches import JobLine
from service.store.engine import Store, open_store
from service.store.similarities import similarities

#: Pairs on the screen and on the page; the JSON has all.
_MOST_SHOWN = 100


def similar(
    batch: BatchId,
    given: Annotated[
        Path | None, typer.Option(help="A file or folder of Python that students were given besides; it is left out.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="A folder for a page with the evidence side by side.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
) -> None:
    """Whose submissions of a batch are alike, in what is written and in what their robots did; for staff only.

    It is a reason to look and to ask, and proves nothing. No marks change, and no student is shown any of it.
    """
    if output is not None:
        prepare_folder(output)
    with open_store(load_settings()) as store:
        with store.reading() as session:
            batch_id = batches.find_batch(session, batch)
            name = batches.batch(session, batch_id).name
            lines = batches.job_lines(session, batch_id)
        view = staff_similarity(similarities(store, lines, given))
        if output is not None:
            page = similarity_page(view, _Texts(store, lines).of, f"Alike in {name}", _MOST_SHOWN)
            path = write_page(output, "similar.html", page)
            print(f"evidence: {path}", file=sys.stderr)
    if json:
        print(as_json(view))
    else:
        _show(view)


def _show(view: SimilarityView) -> None:
    console = Console()
    for found in view.found:
        console.print(Text(what_it_says(found)))
        table = Table("student", "student", "alike", "where", "did the same", box=None, pad_edge=False)
        for row in similarity_rows(found)[:_MOST_SHOWN]:
            table.add_row(*map(Text, row))
        if found.pairs:
            console.print(table)
        if len(found.pairs) > _MOST_SHOWN:
            console.print(f"and {len(found.pairs) - _MOST_SHOWN} pairs more: --json has them all", highlight=False)


class _Texts:
    """The sources that a page quotes, read when they are asked for."""

    def __init__(self, store: Store, lines: list[JobLine]) -> None:
        self._store = store
        self._jobs = {(line.assignment, line.student): line.id for line in lines}

    def of(self, assignment: str, student: str, file: str) -> str:
        with self._store.reading() as session:
            submission = intake.load_submission(session, self._jobs[assignment, student])
        return sources_of(submission)[file]
