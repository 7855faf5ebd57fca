"""Writes reports of grades that are stored, with the plots that are stored beside them.

What a report says is ``service.reports``'; what is not drawn yet is drawn there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from service.queue.plotting import PREFIX, draw
from service.reports.html import BatchRow, batch_index, report
from service.reports.view import staff_view, student_view
from service.reports.written import file_stems, write_page
from service.store import artifacts, batches, grades, intake, policies
from service.store.batches import JobLine
from service.store.engine import Store
from service.store.models import Job, JobState, PlotState, SubmissionRow
from sim.recording import Verdict

_INDEX = "index.html"


@dataclass(frozen=True, slots=True)
class Written:
    """The report of one job."""

    job_id: str
    path: Path


def write_reports(store: Store, job_ids: Iterable[str], folder: Path) -> list[Written]:
    """A page for each graded job, named after its student, and after its assignment where one student has several.

    Raises UsageError when the folder cannot be written to.
    """
    job_ids = list(job_ids)
    with store.reading() as session:
        lines = [batches.job_line(session, job_id) for job_id in job_ids]
    stems = file_stems([(line.student, line.assignment) for line in lines])
    return [
        Written(job_id, write_page(folder, f"{stem}.html", _page(store, job_id)))
        for job_id, stem in zip(job_ids, stems, strict=True)
    ]


def write_batch(
    store: Store, title: str, lines: Sequence[JobLine], problems: Sequence[tuple[str, str]], folder: Path
) -> Path:
    """A page for each graded job, and one that lists them all with what was refused; where that one is.

    Raises UsageError when the folder cannot be written to.
    """
    graded = [line.id for line in lines if line.state is JobState.DONE and line.staff_only is None]
    pages = {written.job_id: written.path.name for written in write_reports(store, graded, folder)}
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


def _page(store: Store, job_id: str) -> str:
    with store.reading() as session:
        grade = grades.load(session, job_id)
        grading_request = intake.load_grading_request(session, job_id)
        job = session.get_one(Job, job_id)
        released = policies.released(session, job_id)
        staff_only = session.get_one(SubmissionRow, job.submission_id).staff_only
        kept = list(artifacts.get(session, job_id, prefix=PREFIX).values())
    files = kept if job.plots is PlotState.DONE else draw(grade, grading_request.assignment)
    plots = {file.name.removeprefix(PREFIX).removesuffix(".png"): file.data for file in files}
    view = student_view(grade, released) if staff_only is None else staff_view(grade)
    return report(view, plots, grading_request.submission)
