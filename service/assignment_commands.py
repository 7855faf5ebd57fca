"""``robomark assignments``: what can be marked, and whether an assignment's files are in order."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from submissions.assignment_file import catalogue, find_assignment

assignments_app = typer.Typer(help="List, show and check assignments.", no_args_is_help=True)

Which = Annotated[str, typer.Argument(help="Its id in the catalogue, or its folder.")]


@assignments_app.command("list")
def list_assignments() -> None:
    """The assignments of the catalogue."""
    table = Table("id", "title", "marks", "trials", box=None, pad_edge=False)
    table.columns[2].justify = table.columns[3].justify = "right"
    for name in catalogue():
        assignment = find_assignment(name)
        trials = sum(1 for _ in assignment.trials())
        table.add_row(assignment.id, assignment.title, f"{assignment.max_marks:g}", str(trials))
    Console().print(table)


@assignments_app.command()
def show(assignment: Which) -> None:
    """What an assignment asks for, and how it is marked."""
    found = find_assignment(assignment)
    console = Console()
    console.print(f"[bold]{found.title}[/bold] ({found.id}), {found.max_marks:g} marks", highlight=False)
    if found.description:
        console.print(found.description.strip(), markup=False, highlight=False)
    console.print(
        f"\nworld: {found.world.background}, robot {found.world.robot}; "
        f"program: {found.parts.program}, responder: {found.parts.responder}",
        highlight=False,
    )
    if found.given:
        console.print(f"given files: {', '.join(sorted(found.given))}", highlight=False)
    table = Table("criterion", "check", "marks", box=None, pad_edge=False)
    table.columns[2].justify = "right"
    for criterion in found.criteria:
        table.add_row(criterion.title, criterion.check, f"{criterion.marks:g}")
    console.print(table)
    for scenario in found.scenarios:
        count = sum(trial.scenario is scenario for trial in found.trials())
        console.print(
            f"scenario {scenario.id}: {count} trials of at most {scenario.seconds:g} s, {scenario.visibility}",
            highlight=False,
        )


@assignments_app.command()
def check(assignment: Which) -> None:
    """Find every mistake in an assignment's files; silent marks are no marks, so it says when all is well."""
    found = find_assignment(assignment)
    trials = sum(1 for _ in found.trials())
    typer.echo(
        f"{found.id}: in order; {len(found.criteria)} criteria, {found.max_marks:g} marks, {trials} trials "
        f"(version {found.version[:12]})"
    )
