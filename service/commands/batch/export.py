"""``robomark batch export``: the marks of a batch as one document, or as a file for each submission.

What a document says is ``service.reports``'.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.batch.tables import unjudged_words
from service.commands.format_option import format_option
from service.grading.grade import Grade
from service.home import for_the_user
from service.reports.formats import FORMATS
from service.reports.written import file_stems
from service.settings import load_settings
from service.store import batches, regrades, results
from service.store.batches import JobLine
from service.store.engine import Store, open_store
from service.store.states import JobState
from sim.errors import UsageError


def export(
    batch: BatchId,
    form: Annotated[str, format_option("What to write.", FORMATS)] = "csv",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", "--output", help="A file instead of the screen; a folder where each submission has a file."
        ),
    ] = None,
    published: Annotated[bool, typer.Option("--published", help="Only the grades that are published.")] = False,
) -> None:
    """The marks of a batch for a spreadsheet, Moodle, Gradescope or a test page, or as JSON."""
    chosen = FORMATS[form]
    if chosen.table is None and output is None:
        raise UsageError(f"{form} is a file for each submission; name a folder with --out")
    with open_store(load_settings()) as store:
        with store.reading() as session:
            batch_id = batches.find_batch(session, batch)
            lines = batches.job_lines(session, batch_id)
            waiting = regrades.unpublished_regrades(session, batch_id)
        graded = _exported(lines, published=published)
        if waiting:
            print(f"robomark: {waiting} regrades are not published: these are the grades that stand", file=sys.stderr)
        if unjudged := unjudged_words(graded):
            print(f"robomark: {unjudged}", file=sys.stderr)
        if chosen.table is None:
            if chosen.document is not None and output is not None:
                _write_each(store, graded, chosen.document, chosen.suffix, output)
            return
        text = chosen.table([grade for _, grade in _grades(store, graded)])
    if output is None:
        sys.stdout.write(text)
    else:
        _write(output, text)


def _exported(lines: Sequence[JobLine], *, published: bool) -> list[JobLine]:
    """The grades that stand, but for those that only staff may see, which are named."""
    graded = [line for line in lines if line.state is JobState.DONE and line.suspect is None]
    hidden = [line for line in graded if line.staff_only is not None]
    for line in hidden:
        print(f"robomark: {line.student} is left out: {line.staff_only}; robomark show {line.id}", file=sys.stderr)
    shown = [line for line in graded if line.staff_only is None]
    return [line for line in shown if line.published_at is not None] if published else shown


def _write_each(
    store: Store, lines: Sequence[JobLine], document: Callable[[Grade], str], suffix: str, folder: Path
) -> None:
    """A file a submission, named after its student, and after its assignment where one student has several."""
    try:
        with for_the_user():
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from None
    stems = file_stems([(line.student, line.assignment) for line in lines])
    for stem, (_, grade) in zip(stems, _grades(store, lines), strict=True):
        _write(folder / f"{stem}{suffix}", document(grade))
    print(f"{len(stems)} files in {folder}")


def _write(path: Path, text: str) -> None:
    try:
        with for_the_user():
            path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from None


def _grades(store: Store, lines: Iterable[JobLine]) -> Iterator[tuple[JobLine, Grade]]:
    for line in lines:
        with store.reading() as session:
            yield line, results.load(session, line.id)
