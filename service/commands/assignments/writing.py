"""``robomark assignments new``, ``export`` and ``autograder``: write the folders of assignments and autograders."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from service.commands.assignments.arguments import AssignmentArgument, format_count
from service.commands.output import print_json, print_line
from service.home import user_permissions
from submissions.assignment.folder import FILE_NAME


def new(
    folder: Annotated[Path, typer.Argument(help="The folder to create. Its name becomes the assignment's id.")],
    like: Annotated[
        str | None, typer.Option(help="Start with a copy of this assignment instead of the commented example.")
    ] = None,
) -> None:
    """Create the folder of a new assignment with a reference solution, as a template to edit."""
    from submissions.assignment.export import create_assignment

    with user_permissions():
        create_assignment(folder, like)
    print_json(output=folder)
    print_line(f"{folder}: change {FILE_NAME}, then: robomark assignments check {shlex.quote(str(folder))}")


def export(
    assignment: AssignmentArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="A folder to write to, or a .zip file to create.")],
    student: Annotated[
        bool,
        typer.Option("--student", help="Export only the files for students: task, starter program and given files."),
    ] = False,
) -> None:
    """Export an assignment: all of it, or with --student the part that students may see."""
    from submissions.assignment.export import export_all, export_for_students

    with user_permissions():
        file_count = export_for_students(assignment, output) if student else export_all(assignment, output)
    print_json(output=output, files=file_count)
    print_line(f"{output}: {format_count(file_count, 'file', 'files')}")


def autograder(
    assignment: AssignmentArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder to create.")],
) -> None:
    """Create the folder of a Gradescope autograder. It contains this installation's secret."""
    from service.autograder import write_autograder
    from service.home_secret import load_home_secret
    from service.settings import load_settings

    with user_permissions():
        write_autograder(assignment, output, load_home_secret(load_settings()))
    print_json(output=output)
    print_line(f"{output}: zip the contents of this folder and upload the zip to Gradescope")
