"""``robomark assignments``: what can be marked, and whether an assignment's files are in order."""

from __future__ import annotations

import re
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from service.reports.readable import one_line, readable
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
        table.add_row(assignment.id, Text(one_line(assignment.title)), f"{assignment.max_marks:g}", str(trials))
    Console().print(table)


@assignments_app.command()
def show(assignment: Which) -> None:
    """What an assignment asks for, and how it is marked."""
    found = find_assignment(assignment)
    console = Console()
    title = Text(one_line(found.title), style="bold")
    console.print(title.append(f" ({found.id}), {found.max_marks:g} marks", style="not bold"))
    if found.description:
        console.print(Text(_flowing(readable(found.description.strip(), 20_000, lines=500))))
    console.print(
        f"\nworld: {found.world.background}, robot {found.world.robot}; "
        f"program: {found.parts.program}, responder: {found.parts.responder}",
        highlight=False,
        markup=False,
    )
    if found.given:
        console.print(f"given files: {', '.join(sorted(found.given))}", highlight=False, markup=False)
    table = Table("criterion", "check", "marks", box=None, pad_edge=False)
    table.columns[2].justify = "right"
    for criterion in found.criteria:
        table.add_row(Text(one_line(criterion.title)), criterion.check, f"{criterion.marks:g}")
    console.print(table)
    for scenario in found.scenarios:
        trials = _count(sum(trial.scenario is scenario for trial in found.trials()), "trial", "trials")
        console.print(
            f"scenario {scenario.id}: {trials} of at most {scenario.seconds:g} s, {scenario.visibility}",
            highlight=False,
        )


@assignments_app.command()
def check(assignment: Which) -> None:
    """Find every mistake in an assignment's files; silent marks are no marks, so it says when all is well."""
    found = find_assignment(assignment)
    criteria = _count(len(found.criteria), "criterion", "criteria")
    trials = _count(sum(1 for _ in found.trials()), "trial", "trials")
    typer.echo(f"{found.id}: in order; {criteria}, {found.max_marks:g} marks, {trials} (version {found.version[:12]})")


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _flowing(text: str) -> str:
    """Paragraphs on one line each, to be broken by whoever shows them; lists and indented lines stay."""
    return re.sub(r"(?<=\S)\n(?=[^\W\d])", " ", text)
