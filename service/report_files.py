"""Report files of stored grades: loads the data once and passes it to ``service.reports``.

``service.reports`` decides on the content without reading the database. Missing plots are drawn here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sqlalchemy.orm import Session

from service.batch_rows import build_rejected_row, build_row, describe_missing_grade
from service.file_names import make_portable_name
from service.grading.grade import Grade
from service.language import ENGLISH, Language
from service.plotting import draw_plots, load_own_floors
from service.reports.html import (
    BatchRow,
    ReportParts,
    render_batch_index,
    render_or_explain,
    render_refusal_page,
    render_report_page,
    render_report_parts,
)
from service.reports.output_files import build_file_stems, build_refused_stems, write_film, write_page, write_replay
from service.reports.replay.document import Pixels, build_grade_replay
from service.reports.rows import ReportPage, describe_missing_part
from service.reports.view import (
    NO_OVERLAY,
    OverlayTrials,
    View,
    build_staff_view,
    build_student_view,
    find_worst_trial,
    list_scenarios,
    select_overlay_trials,
)
from service.store.batches import rankings, stored_requests
from service.store.batches.job_lines import JobLine
from service.store.courses import policies
from service.store.engine import Store
from service.store.grades import plots, results
from service.store.states import JobState, PlotState, Standing
from sim.errors import UsageError
from sim.floors import list_floor_names
from sim.recording import Verdict
from submissions.assignment.folder import REFERENCE
from submissions.student_identity import RejectedSubmission
from submissions.submission import Submission

_INDEX = "index.html"


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """The report file of a job, and its plots as a mapping of name to PNG."""

    path: Path
    plots: Mapping[str, bytes]


def write_report(
    store: Store,
    line: JobLine,
    grade: Grade,
    folder: Path,
    stem: str,
    overlay_line: JobLine | None = None,
    language: Language = ENGLISH,
) -> WrittenReport:
    """Write the page of a graded job as ``stem``.html; its replay overlays the trials of ``overlay_line``.

    Raises UsageError if the folder is not writable, or the reader may not see those trials.
    """
    html, drawn_plots = _render_page(store, line, grade, overlay_line, language)
    return WrittenReport(write_page(folder, make_portable_name(f"{stem}.html"), html), drawn_plots)


def write_grade_replay(
    store: Store,
    line: JobLine,
    grade: Grade,
    path: Path,
    overlay_line: JobLine | None = None,
    language: Language = ENGLISH,
) -> None:
    """Write the replay of all visible trials of a graded job, overlaid with those of ``overlay_line``.

    Raises UsageError if the file cannot be written, or the reader may not see those trials.
    """
    with store.reading() as session:
        submission = stored_requests.load_submission(session, line.id)
        floors = load_own_floors(stored_requests.load_assignment(session, line.id))
        view = _build_view(session, line, grade, language)
        overlay_trials = _load_other_trials(session, line, view, overlay_line)
    write_replay(path, build_grade_replay(view, submission, floors, overlay_trials=overlay_trials), language)


def write_grade_film(store: Store, line: JobLine, grade: Grade, path: Path, number: int | None) -> None:
    """Write the film of a visible trial by its number in the report; without one, of the trial that it opens with.

    Raises UsageError if there is none, or the file cannot be written.
    """
    with store.reading() as session:
        floors = load_own_floors(stored_requests.load_assignment(session, line.id))
        visible_grade = _build_view(session, line, grade).grade
    if not visible_grade.trials:
        raise UsageError(f"{line.id} has no visible trial, so there is no film")
    if number is not None and not 1 <= number <= len(visible_grade.trials):
        raise UsageError(f"--trial {number}: expected 1 to {len(visible_grade.trials)}, as the replay numbers them")
    index = find_worst_trial(visible_grade, list_scenarios(visible_grade)[0]) if number is None else number - 1
    write_film(path, visible_grade.trials[index], floors)


def render_report_pages(
    store: Store, lines: Sequence[JobLine], refusals: Sequence[RejectedSubmission]
) -> Iterator[ReportPage]:
    """Yield a page for each graded job, then one for each rejection."""
    for line in lines:
        with store.reading() as session:
            grade = results.load_grade(session, line.id)
        yield ReportPage(build_row(line, grade), _render_page(store, line, grade)[0])
    for refusal in refusals:
        row = build_rejected_row(refusal)
        yield ReportPage(row, render_refusal_page(row))


def write_batch_reports(
    store: Store, title: str, lines: Sequence[JobLine], refusals: Sequence[RejectedSubmission], folder: Path
) -> Path:
    """Write a page for each graded job and rejection, and an index. Returns the path of the index.

    Pages are named after the student, and after the assignment if a student has several. Raises UsageError if the
    folder is not writable.
    """
    graded_lines = [line for line in lines if not describe_missing_grade(line)]
    stems = [
        *build_file_stems([(line.student, line.assignment) for line in graded_lines]),
        *build_refused_stems([(refusal.source, refusal.student.id) for refusal in refusals]),
    ]
    pages = render_report_pages(store, graded_lines, refusals)
    paths = [
        write_page(folder, make_portable_name(f"{stem}.html"), page.html)
        for stem, page in zip(stems, pages, strict=True)
    ]
    page_names = {line.id: path.name for line, path in zip(graded_lines, paths, strict=False)}
    rows = [
        BatchRow(
            line.student,
            line.marks,
            line.max_marks,
            None if line.verdict is None else Verdict(line.verdict),
            page_names.get(line.id),
            describe_missing_grade(line) or describe_missing_part(line.missing),
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
        for refusal, path in zip(refusals, paths[len(graded_lines) :], strict=True)
    ]
    sandbox = ", ".join(sorted({line.sandbox for line in lines if line.sandbox}))
    rows.sort(key=lambda row: row.student)
    with store.reading() as session:
        ranks = rankings.build_rank_tables(session, lines)
    return write_page(folder, _INDEX, render_batch_index(rows, title, sandbox, ranks))


def render_report_body(store: Store, job_id: str, plotted: PlotState, view: View) -> ReportParts:
    """Return the report of a graded job for one reader, as parts of another page.

    Plots that are not drawn yet are left out, so that the page does not wait for them.
    """
    return render_report_parts(view, *_load_report_data(store, job_id, plotted, view))


def render_standalone_report(store: Store, job_id: str, plotted: PlotState, view: View) -> str:
    """Return the report as a standalone page."""
    return render_report_page(view, *_load_report_data(store, job_id, plotted, view))


def render_each_report(
    session: Session, views: Iterable[tuple[str, View]], job_ids: Collection[str]
) -> Iterator[tuple[str, View, str]]:
    """Yield the id, view and standalone report of each graded job.

    All data is read with a fixed number of statements. ``views`` must match ``job_ids``, ordered by id.
    """
    submissions, all_plots = (
        stored_requests.load_each_submission(session, job_ids),
        plots.load_each_plots(session, job_ids),
    )
    floors: dict[tuple[str, str], Mapping[str, Pixels]] = {}
    for (job_id, view), (_, submission), (_, report_plots) in zip(views, submissions, all_plots, strict=True):
        version = (view.grade.assignment, view.grade.assignment_version)
        if not _has_built_in_floors(view) and version not in floors:
            floors[version] = load_own_floors(stored_requests.load_assignment(session, job_id))
        page = partial(render_report_page, view, report_plots, submission, floors.get(version, {}))
        yield job_id, view, render_or_explain(view, page)


def _has_built_in_floors(view: View) -> bool:
    return {trial.recording.background for trial in view.grade.trials} <= set(list_floor_names())


def _load_report_data(
    store: Store, job_id: str, plot_state: PlotState, view: View
) -> tuple[Mapping[str, bytes], Submission, Mapping[str, Pixels]]:
    """Load the plots, the submission and the floors of a report."""
    with store.reading() as session:
        submission = stored_requests.load_submission(session, job_id)
        drawn_plots = plots.load_plots(session, job_id) if plot_state is PlotState.DONE else {}
        floors = {} if _has_built_in_floors(view) else load_own_floors(stored_requests.load_assignment(session, job_id))
    return drawn_plots, submission, floors


def _render_page(
    store: Store, line: JobLine, grade: Grade, overlay_line: JobLine | None = None, language: Language = ENGLISH
) -> tuple[str, Mapping[str, bytes]]:
    """Return the page of a graded job, and its plots."""
    with store.reading() as session:
        submission = stored_requests.load_submission(session, line.id)
        view = _build_view(session, line, grade, language)
        overlay_trials = _load_other_trials(session, line, view, overlay_line)
        drawn_plots = plots.load_plots(session, line.id) if line.plots is PlotState.DONE else None
        has_built_in_floors = {trial.recording.background for trial in grade.trials} <= set(list_floor_names())
        assignment = (
            None
            if drawn_plots is not None and has_built_in_floors
            else stored_requests.load_assignment(session, line.id)
        )
    rendered_plots = dict(drawn_plots or {})

    def render() -> str:
        if drawn_plots is None and assignment is not None:
            rendered_plots.update(draw_plots(grade, assignment, submission))
        floors = load_own_floors(assignment) if assignment is not None else {}
        return render_report_page(view, rendered_plots, submission, floors, overlay_trials)

    return render_or_explain(view, render), rendered_plots


def _build_view(session: Session, line: JobLine, grade: Grade, language: Language = ENGLISH) -> View:
    """Return the part of a job's grade that the reader of its report may see."""
    if line.staff_only is not None:
        return build_staff_view(grade, language)
    return build_student_view(grade, policies.load_visibilities(session, line.id), language)


def _load_other_trials(session: Session, line: JobLine, view: View, overlay_line: JobLine | None) -> OverlayTrials:
    """Return the trials of ``overlay_line`` that the reader of the view may see."""
    if overlay_line is None:
        return NO_OVERLAY
    reason = describe_missing_grade(overlay_line)
    if not reason and overlay_line.standing is Standing.PROPOSED:
        reason = "a regrade that is not published"
    if reason and (overlay_line.state is not JobState.DONE or not view.staff):
        raise UsageError(f"{overlay_line.id} cannot be shown over {line.id}: {reason}")
    try:
        return select_overlay_trials(
            view,
            results.load_grade(session, overlay_line.id),
            _label_overlay(overlay_line, line),
            policies.load_visibilities(session, line.id),
        )
    except UsageError as error:
        raise UsageError(f"{overlay_line.id} cannot be shown over {line.id}: {error}") from None


def _label_overlay(overlay_line: JobLine, line: JobLine) -> str:
    """Return the label of the overlaid trials in the report of ``line``."""
    if overlay_line.student == REFERENCE:
        return "the reference"
    if overlay_line.student != line.student:
        return overlay_line.student
    return f"attempt {overlay_line.attempt}" + (
        f", grade {overlay_line.id}" if overlay_line.attempt == line.attempt else ""
    )
