"""Report files of stored grades: loads the data once and passes it to ``service.reports``.

``service.reports`` decides on the content without reading the database. Missing plots are drawn here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy.orm import Session

from service.batch_rows import refused_row, row_of, why_not_shown
from service.grading.grade import Grade
from service.language import ENGLISH, Language
from service.plotting import draw, own_floors
from service.reports.html import BatchRow, ReportParts, batch_index, refusal_page, report, report_parts
from service.reports.replay.document import Pixels, replay_of_grade
from service.reports.rows import ReportPage, missing_words
from service.reports.view import (
    NO_OTHERS,
    OtherTrials,
    View,
    other_trials,
    scenarios,
    staff_view,
    student_view,
    worst_trial,
)
from service.reports.written import file_stems, refused_stems, write_film, write_page, write_replay
from service.store.batches import intake, rankings
from service.store.batches.batches import JobLine
from service.store.courses import policies
from service.store.engine import Store
from service.store.grades import plots, results
from service.store.states import JobState, PlotState, Standing
from sim.errors import UsageError
from sim.floors import names
from sim.recording import Verdict
from submissions.assignment.folder import REFERENCE
from submissions.student_identity import Refusal
from submissions.submission import Submission

_INDEX = "index.html"


@dataclass(frozen=True, slots=True)
class Written:
    """The report file of a job, and its plots as a mapping of name to PNG."""

    path: Path
    plots: Mapping[str, bytes]


def write_report(
    store: Store,
    line: JobLine,
    grade: Grade,
    folder: Path,
    stem: str,
    over: JobLine | None = None,
    language: Language = ENGLISH,
) -> Written:
    """Write the page of a graded job as ``stem``.html; its replay overlays the trials of ``over``.

    Raises UsageError if the folder is not writable, or the reader may not see those trials.
    """
    html, drawn = _page(store, line, grade, over, language)
    return Written(write_page(folder, f"{stem}.html", html), drawn)


def write_grade_replay(
    store: Store,
    line: JobLine,
    grade: Grade,
    path: Path,
    over: JobLine | None = None,
    language: Language = ENGLISH,
) -> None:
    """Write the replay of all visible trials of a graded job, overlaid with those of ``over``.

    Raises UsageError if the file cannot be written, or the reader may not see those trials.
    """
    with store.reading() as session:
        submission = intake.load_submission(session, line.id)
        floors = own_floors(intake.load_assignment(session, line.id))
        view = _view(session, line, grade, language)
        others = _others(session, line, view, over)
    write_replay(path, replay_of_grade(view, submission, floors, others=others), language)


def write_grade_film(store: Store, line: JobLine, grade: Grade, path: Path, number: int | None) -> None:
    """Write the film of a visible trial by its number in the report; without one, of the trial that it opens with.

    Raises UsageError if there is none, or the file cannot be written.
    """
    with store.reading() as session:
        floors = own_floors(intake.load_assignment(session, line.id))
        seen = _view(session, line, grade).grade
    if not seen.trials:
        raise UsageError(f"{line.id} has no visible trial, so there is no film")
    if number is not None and not 1 <= number <= len(seen.trials):
        raise UsageError(f"--trial {number}: expected 1 to {len(seen.trials)}, as the replay numbers them")
    index = worst_trial(seen, scenarios(seen)[0]) if number is None else number - 1
    write_film(path, seen.trials[index], floors)


def report_pages(store: Store, lines: Sequence[JobLine], refusals: Sequence[Refusal]) -> Iterator[ReportPage]:
    """Yield a page for each graded job, then one for each rejection."""
    for line in lines:
        with store.reading() as session:
            grade = results.load(session, line.id)
        yield ReportPage(row_of(line, grade), _page(store, line, grade)[0])
    for refusal in refusals:
        row = refused_row(refusal)
        yield ReportPage(row, refusal_page(row))


def write_batch(store: Store, title: str, lines: Sequence[JobLine], refusals: Sequence[Refusal], folder: Path) -> Path:
    """Write a page for each graded job and rejection, and an index. Returns the path of the index.

    Pages are named after the student, and after the assignment if a student has several. Raises UsageError if the
    folder is not writable.
    """
    graded = [line for line in lines if not why_not_shown(line)]
    names = [(line.student, line.assignment) for line in graded]
    stems = [*file_stems(names), *refused_stems([(refusal.source, refusal.student.id) for refusal in refusals])]
    pages = report_pages(store, graded, refusals)
    paths = [write_page(folder, f"{stem}.html", page.html) for stem, page in zip(stems, pages, strict=True)]
    own = {line.id: path.name for line, path in zip(graded, paths, strict=False)}
    rows = [
        BatchRow(
            line.student,
            line.marks,
            line.max_marks,
            None if line.verdict is None else Verdict(line.verdict),
            own.get(line.id),
            why_not_shown(line) or missing_words(line.missing),
            line.name if line.name != line.student else "",
        )
        for line in lines
    ]
    rows += [
        BatchRow(
            refusal.student.id or refusal.source,
            report=path.name,
            note=f"rejected: {refusal.sentence}",
            name=refusal.student.name if refusal.student.name != refusal.student.id else "",
        )
        for refusal, path in zip(refusals, paths[len(graded) :], strict=True)
    ]
    sandbox = ", ".join(sorted({line.sandbox for line in lines if line.sandbox}))
    rows.sort(key=lambda row: row.student)
    with store.reading() as session:
        ranks = rankings.rank_tables(session, lines)
    return write_page(folder, _INDEX, batch_index(rows, title, sandbox, ranks))


def report_body(store: Store, job_id: str, plotted: PlotState, view: View) -> ReportParts:
    """Return the report of a graded job for one reader, as parts of another page.

    Plots that are not drawn yet are left out, so that the page does not wait for them.
    """
    return report_parts(view, *_kept(store, job_id, plotted, view))


def report_alone(store: Store, job_id: str, plotted: PlotState, view: View) -> str:
    """Return the report as a standalone page."""
    return report(view, *_kept(store, job_id, plotted, view))


def report_each(
    session: Session, views: Iterable[tuple[str, View]], job_ids: Collection[str]
) -> Iterator[tuple[str, View, str]]:
    """Yield the id, view and standalone report of each graded job.

    All data is read with a fixed number of statements. ``views`` must match ``job_ids``, ordered by id.
    """
    submissions, drawn = intake.load_each_submission(session, job_ids), plots.load_each(session, job_ids)
    floors: dict[tuple[str, str], Mapping[str, Pixels]] = {}
    for (job_id, view), (_, submission), (_, plotted) in zip(views, submissions, drawn, strict=True):
        version = (view.grade.assignment, view.grade.assignment_version)
        if not _is_built_in(view) and version not in floors:
            floors[version] = own_floors(intake.load_assignment(session, job_id))
        yield job_id, view, report(view, plotted, submission, floors.get(version, {}))


def _is_built_in(view: View) -> bool:
    return {trial.recording.background for trial in view.grade.trials} <= set(names())


def _kept(
    store: Store, job_id: str, plotted: PlotState, view: View
) -> tuple[Mapping[str, bytes], Submission, Mapping[str, Pixels]]:
    """Load the plots, the submission and the floors of a report."""
    with store.reading() as session:
        submission = intake.load_submission(session, job_id)
        drawn = plots.load(session, job_id) if plotted is PlotState.DONE else {}
        floors = {} if _is_built_in(view) else own_floors(intake.load_assignment(session, job_id))
    return drawn, submission, floors


def _page(
    store: Store, line: JobLine, grade: Grade, over: JobLine | None = None, language: Language = ENGLISH
) -> tuple[str, Mapping[str, bytes]]:
    """Return the page of a graded job, and its plots."""
    with store.reading() as session:
        submission = intake.load_submission(session, line.id)
        view = _view(session, line, grade, language)
        others = _others(session, line, view, over)
        drawn = plots.load(session, line.id) if line.plots is PlotState.DONE else None
        built_in = {trial.recording.background for trial in grade.trials} <= set(names())
        assignment = None if drawn is not None and built_in else intake.load_assignment(session, line.id)
    if drawn is None and assignment is not None:
        drawn = draw(grade, assignment, submission)
    found = drawn or {}
    floors = own_floors(assignment) if assignment is not None else {}
    return report(view, found, submission, floors, others), found


def _view(session: Session, line: JobLine, grade: Grade, language: Language = ENGLISH) -> View:
    """Return the part of a job's grade that the reader of its report may see."""
    if line.staff_only is not None:
        return staff_view(grade, language)
    return student_view(grade, policies.released(session, line.id), language)


def _others(session: Session, line: JobLine, view: View, over: JobLine | None) -> OtherTrials:
    """Return the trials of ``over`` that the reader of the view may see."""
    if over is None:
        return NO_OTHERS
    reason = why_not_shown(over)
    if not reason and over.standing is Standing.PROPOSED:
        reason = "a regrade that is not published"
    if reason and (over.state is not JobState.DONE or not view.staff):
        raise UsageError(f"{over.id} cannot be shown over {line.id}: {reason}")
    try:
        return other_trials(
            view, results.load(session, over.id), _called(over, line), policies.released(session, line.id)
        )
    except UsageError as error:
        raise UsageError(f"{over.id} cannot be shown over {line.id}: {error}") from None


def _called(over: JobLine, line: JobLine) -> str:
    """Return the label of the overlaid trials in the report of ``line``."""
    if over.student == REFERENCE:
        return "the reference"
    if over.student != line.student:
        return over.student
    return f"attempt {over.attempt}" + (f", grade {over.id}" if over.attempt == line.attempt else "")
