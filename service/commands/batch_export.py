"""``robomark batch export``: the marks of a batch as one document, or as a file for each submission.

What a document says is ``service.reports``'.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import typer

from service.commands.batch_control import BatchId
from service.commands.batch_tables import unjudged_words
from service.grading.grade import Grade
from service.home import for_the_user
from service.reports.csv_output import marks_csv, moodle_csv
from service.reports.gradescope import gradescope_text
from service.reports.json_output import json_document
from service.reports.junit import junit_text
from service.reports.written import file_stems
from service.settings import load_settings
from service.store import batches, regrades, results
from service.store.batches import JobLine
from service.store.engine import Store, open_store
from service.store.models import JobState
from sim.errors import UsageError


class ExportFormat(StrEnum):
    """What ``batch export`` writes."""

    CSV = "csv"
    MOODLE = "moodle"
    GRADESCOPE = "gradescope"
    JUNIT = "junit"
    JSON = "json"


@dataclass(frozen=True, slots=True)
class _ForEach:
    """A format with a document of its own for each submission."""

    suffix: str
    text: Callable[[Grade], str]


def export(
    batch: BatchId,
    form: Annotated[ExportFormat, typer.Option("--format", help="What to write.")] = ExportFormat.CSV,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", "--output", help="A file instead of the screen; for gradescope and junit, a folder."
        ),
    ] = None,
    published: Annotated[bool, typer.Option("--published", help="Only the grades that are published.")] = False,
) -> None:
    """The marks of a batch for a spreadsheet, Moodle, Gradescope or a test page, or as JSON."""
    each = _FOR_EACH.get(form)
    if each is not None and output is None:
        raise UsageError(f"{form.value} is a file for each submission; name a folder with --out")
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
        if each is not None and output is not None:
            _write_each(store, graded, each, output)
            return
        text = _WHOLE[form]([grade for _, grade in _grades(store, graded)])
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


def _write_each(store: Store, lines: Sequence[JobLine], each: _ForEach, folder: Path) -> None:
    """A file a submission, named after its student, and after its assignment where one student has several."""
    try:
        with for_the_user():
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from None
    stems = file_stems([(line.student, line.assignment) for line in lines])
    for stem, (_, grade) in zip(stems, _grades(store, lines), strict=True):
        _write(folder / f"{stem}{each.suffix}", each.text(grade))
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


def _json(found: Sequence[Grade]) -> str:
    return json.dumps([{"student": grade.student, **json_document(grade)} for grade in found], indent=2) + "\n"


_WHOLE: Mapping[ExportFormat, Callable[[Sequence[Grade]], str]] = MappingProxyType(
    {ExportFormat.CSV: marks_csv, ExportFormat.MOODLE: moodle_csv, ExportFormat.JSON: _json}
)
_FOR_EACH: Mapping[ExportFormat, _ForEach] = MappingProxyType(
    {
        ExportFormat.GRADESCOPE: _ForEach(".json", gradescope_text),
        ExportFormat.JUNIT: _ForEach(".xml", junit_text),
    }
)
