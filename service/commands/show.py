"""``robomark show``: one stored grade."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.batch.batch_summary import list_remarks
from service.commands.installation import open_installation
from service.commands.options import FilmOption, LanguageOption
from service.commands.output import print_json, print_line, print_note
from service.home import user_permissions
from service.language import SOURCE_LANGUAGE, load_language
from service.operations import stored_grades
from service.operations.context import Actor, Service
from service.operations.stored_grades import JobLine
from service.operations.types import JobState
from sim.errors import UsageError

#: This word cannot be the beginning of an id, because ids contain no ``o``.
_PREVIOUS = "before"


def show(
    grade: Annotated[str, typer.Argument(help="The grade's id, or its first characters.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the report and its plots to this folder."),
    ] = None,
    replay: Annotated[
        Path | None,
        typer.Option("--replay", help="Write a replay page of the trials to this file, or their data to a .json file."),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(
            help="Add the trials of this grade to the replay: an earlier grade of the same student "
            f"('{_PREVIOUS}': the previous one), or the grade of the reference."
        ),
    ] = None,
    language: LanguageOption = SOURCE_LANGUAGE,
    film: FilmOption = None,
    trial: Annotated[
        int | None, typer.Option(help="The trial for the film, as numbered in the replay. Default: the first.")
    ] = None,
) -> None:
    """Show a stored grade: its marks and the evidence for them."""
    if over is not None and output is None and replay is None:
        raise UsageError("--over needs a replay; expected --replay or --output too")
    if trial is not None and film is None:
        raise UsageError("--trial needs a film; expected --film too")
    with open_installation() as (service, actor):
        line = stored_grades.find(service, actor, grade)
        overlay_grade = None if over is None else _find_overlay_grade(service, actor, over, line)
        if line.state is not JobState.DONE:
            print_json(job=line, grade=None)
            print_line(_describe_ungraded(line))
            return
        # These modules load slowly, so the grade is looked up first.
        from service.reports.formats.json_output import build_json_document
        from service.reports.formats.text import render_plain_text
        from service.reports.view import build_staff_view

        summary, submission = stored_grades.load_summary(service, actor, line.id)
        view = build_staff_view(summary)
        print_json(job=line, grade=build_json_document(view, submission))
        print_line(render_plain_text(view, submission).rstrip("\n"))
        origin = f"graded by {line.worker}" if line.copied_from is None else "not run"
        print_line(
            "; ".join(
                [f"plots: {line.plots.value}", origin, f"the student's attempt {line.attempt}", *list_remarks(line)]
            )
        )
        if replay is None and film is None and output is None:
            return
        # Writing a report draws missing plots, so this import is slow.
        from service.report_files import write_grade_film, write_grade_replay, write_report
        from service.reports.output_files import build_file_stem

        full_grade = stored_grades.load(service, actor, line.id)
        report_language = load_language(language)
        if replay is not None:
            write_grade_replay(service.store, line, full_grade, replay, overlay_grade, report_language)
            print_note(f"replay: {replay}")
        if film is not None:
            write_grade_film(service.store, line, full_grade, film, trial)
            print_note(f"film: {film}")
        if output is None:
            return
        report = write_report(
            service.store, line, full_grade, output, build_file_stem(line.student), overlay_grade, report_language
        )
        print_note(f"report: {report.path}")
        for name, data in report.plots.items():
            path = output / f"{line.id}-plot-{name}.png"
            with user_permissions():
                path.write_bytes(data)
            print_note(f"plot: {path}")


def _find_overlay_grade(service: Service, actor: Actor, overlay_id: str, line: JobLine) -> JobLine:
    if overlay_id == _PREVIOUS:
        return stored_grades.find_previous(service, actor, line.id)
    return stored_grades.find(service, actor, overlay_id)


def _describe_ungraded(line: JobLine) -> str:
    reason = f": {line.error}" if line.error else ""
    return f"{line.id}: {line.source} of {line.student}, {line.assignment}: {line.state.value}{reason}"
