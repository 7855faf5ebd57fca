"""``robomark assignments new``, ``export`` and ``autograder``: write the folders of assignments and autograders."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from service.commands.assignments.which import Which, count_words
from service.commands.shown import document, tell
from service.home import for_the_user
from submissions.assignment.folder import FILE_NAME


def new(
    folder: Annotated[Path, typer.Argument(help="The folder to create. Its name becomes the assignment's id.")],
    like: Annotated[
        str | None, typer.Option(help="Start with a copy of this assignment instead of the commented example.")
    ] = None,
) -> None:
    """Create the folder of a new assignment with a reference solution, as a template to edit."""
    from submissions.assignment.export import write_new

    with for_the_user():
        write_new(folder, like)
    document(output=folder)
    tell(f"{folder}: change {FILE_NAME}, then: robomark assignments check {shlex.quote(str(folder))}")


def export(
    assignment: Which,
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder to write to, or a .zip file to create.")],
    student: Annotated[
        bool,
        typer.Option("--student", help="Export only the files for students: task, starter program and given files."),
    ] = False,
) -> None:
    """Export an assignment: all of it, or with --student the part that students may see."""
    from submissions.assignment.export import export_for_students, export_whole

    with for_the_user():
        written = export_for_students(assignment, output) if student else export_whole(assignment, output)
    document(output=output, files=written)
    tell(f"{output}: {count_words(written, 'file', 'files')}")


def autograder(
    assignment: Which,
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder to create.")],
) -> None:
    """Create the folder of a Gradescope autograder. It contains this installation's secret."""
    from service.autograder import write_autograder
    from service.home_secret import secret_here
    from service.settings import load_settings

    with for_the_user():
        write_autograder(assignment, output, secret_here(load_settings()))
    document(output=output)
    tell(f"{output}: zip the contents of this folder and upload the zip to Gradescope")
