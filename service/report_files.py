"""Writes reports of grades that are stored: reads what each is made of, once, and hands it to ``service.reports``.

What a report says is decided there, and nothing there reads the database; what is not drawn yet is drawn here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from service.grading.grade import Grade
from service.plotting import draw
from service.reports.html import BatchRow, batch_index, report
from service.reports.view import staff_view, student_view
from service.reports.written import file_stems, write_page
from service.store import intake, plots, policies, results
from service.store.batches import JobLine
from service.store.engine import Store
from service.store.states import JobState, PlotState
from sim.recording import Verdict

_INDEX = "index.html"


@dataclass(frozen=True, slots=True)
class Written:
    """The report of one job, and the plots in it: name -> PNG."""

    path: Path
    plots: Mapping[str, bytes]


def write_report(store: Store, line: JobLine, grade: Grade, folder: Path, stem: str) -> Written:
    """The page of one graded job, called by ``stem``. Raises UsageError when the folder cannot be written to."""
    with store.reading() as session:
        submission = intake.load_submission(session, line.id)
        released = policies.released(session, line.id)
        drawn = plots.load(session, line.id) if line.plots is PlotState.DONE else None
        assignment = intake.load_assignment(session, line.id) if drawn is None else None
    if assignment is not None:
        drawn = draw(grade, assignment, submission)
    found = drawn or {}
    view = student_view(grade, released) if line.staff_only is None else staff_view(grade)
    return Written(write_page(folder, f"{stem}.html", report(view, found, submission)), found)


def write_reports(store: Store, lines: Sequence[JobLine], folder: Path) -> list[Path]:
    """A page for each graded job, named after its student, and after its assignment where one student has several.

    Raises UsageError when the folder cannot be written to.
    """
    stems = file_stems([(line.student, line.assignment) for line in lines])
    paths = []
    for line, stem in zip(lines, stems, strict=True):
        with store.reading() as session:
            grade = results.load(session, line.id)
        paths.append(write_report(store, line, grade, folder, stem).path)
    return paths


def write_batch(
    store: Store, title: str, lines: Sequence[JobLine], problems: Sequence[tuple[str, str]], folder: Path
) -> Path:
    """A page for each graded job, and one that lists them all with what was refused; where that one is.

    Raises UsageError when the folder cannot be written to.
    """
    graded = [line for line in lines if line.state is JobState.DONE and line.staff_only is None]
    paths = write_reports(store, graded, folder)
    pages = {line.id: path.name for line, path in zip(graded, paths, strict=True)}
    rows = [
        BatchRow(
            line.student,
            line.marks,
            line.max_marks,
            None if line.verdict is None else Verdict(line.verdict),
            pages.get(line.id),
            line.error or _remark(line),
        )
        for line in lines
    ]
    rows += [BatchRow(name, note=f"not taken in: {sentence}") for name, sentence in problems]
    sandbox = ", ".join(sorted({line.sandbox for line in lines if line.sandbox}))
    return write_page(folder, _INDEX, batch_index(rows, title, sandbox))


def _remark(line: JobLine) -> str:
    if line.staff_only is not None:
        return f"for staff only: {line.staff_only}"
    return "" if line.state is JobState.DONE else line.state.value
