"""``robomark assignments``: what can be marked, and whether an assignment's files are in order."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table
from rich.text import Text

from service.autograder import write_autograder
from service.commands.example_table import catalogue_table, examples_table, measures_table
from service.grading.example_check import CheckedAssignment, check_examples
from service.grading.trial_runner import TrialRunner
from service.home import for_the_user
from service.home_secret import secret_here
from service.reports.readable import one_line, readable
from service.settings import load_settings
from sim.errors import AssignmentError, UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import EXAMPLES, EXPECTED, REFERENCE, add_expected
from submissions.assignment.export import export_for_students, export_whole, write_new
from submissions.assignment.folder import FILE_NAME, catalogue
from submissions.assignment.reader import find_assignment

assignments_app = typer.Typer(help="List, show, check, make and export assignments.", no_args_is_help=True)

_WIDTH_OF_FILES = 160

Which = Annotated[str, typer.Argument(help="Its id in the catalogue, or its folder.")]


@assignments_app.command("list")
def list_assignments() -> None:
    """The assignments of the catalogue."""
    table = Table("section", "id", "title", "marks", "trials", box=None, pad_edge=False)
    table.columns[3].justify = table.columns[4].justify = "right"
    table.columns[1].no_wrap = True
    table.columns[1].min_width = max(map(len, catalogue()))
    for name in catalogue():
        assignment = find_assignment(name)
        trials = sum(1 for _ in assignment.trials())
        title = Text(one_line(assignment.title))
        table.add_row(assignment.section, assignment.id, title, f"{assignment.max_marks:g}", str(trials))
    _console().print(table)


def _cell(which: str) -> str:
    """The marked robot program of a notebook, in words."""
    if which.isdecimal():
        return f"robot program {which}"
    return "the last robot program" if which == "last" else f'the cell tagged "{which.removeprefix("tag:")}"'


def _setting(found: Assignment) -> str:
    if not found.scenarios:
        return f"no robot is run; responder: {found.parts.responder}"
    agents = "".join(f", {name}: {who}" for name, who in found.parts.agents.items())
    noise = "" if found.world.noise == "course" else f", motor noise in {found.world.noise}"
    return (
        f"world: {found.world.background}, robot {found.world.robot}{noise}; "
        f"program: {found.parts.program}, responder: {found.parts.responder}{agents}; "
        f"of a notebook: {_cell(found.parts.cell)}"
    )


@assignments_app.command()
def show(assignment: Which) -> None:
    """What an assignment asks for, and how it is marked."""
    found = find_assignment(assignment)
    console = Console()
    title = Text(one_line(found.title), style="bold")
    console.print(title.append(f" ({found.id}), {found.max_marks:g} marks", style="not bold"))
    if found.description:
        console.print(Text(_flowing(readable(found.description.strip(), 20_000, lines=500))))
    console.print(f"\n{_setting(found)}", highlight=False, markup=False)
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
def check(
    assignment: Annotated[str | None, typer.Argument(help="Its id in the catalogue, or its folder.")] = None,
    everything: Annotated[bool, typer.Option("--all", help="Check the whole catalogue and print one table.")] = False,
    write_expected: Annotated[
        bool, typer.Option("--write-expected", help="Note what examples got of which expected.toml says nothing yet.")
    ] = False,
) -> None:
    """Find every mistake in an assignment's files, and grade its examples: do they get what they must?"""
    if everything == (assignment is not None):
        raise UsageError("name one assignment to check, or give --all for the whole catalogue")
    if everything and write_expected:
        raise UsageError("name the one assignment whose expectations are to be written")
    with TrialRunner() as runner:
        if assignment is not None:
            checked = [check_examples(assignment, runner=runner)]
            if write_expected:
                checked = [_noted(assignment, checked[0])]
            _print_checked(checked[0])
        else:
            checked = [check_examples(name, runner=runner) for name in track(catalogue(), "grading", transient=True)]
            _console().print(catalogue_table(checked))
    problems = [f"{each.assignment.id}: {problem}" for each in checked for problem in each.problems]
    if problems:
        raise AssignmentError("\n".join(problems))
    if everything:
        count = sum(len(each.examples) for each in checked)
        typer.echo(f"{len(checked)} assignments, {count} examples: all as expected")


@assignments_app.command()
def new(
    folder: Annotated[Path, typer.Argument(help="The folder to make; its name becomes the assignment's id.")],
    like: Annotated[
        str | None, typer.Option(help="Begin with a copy of this assignment instead of the commented example.")
    ] = None,
) -> None:
    """Make the folder of a new assignment, with a reference solution, ready to be changed."""
    with for_the_user():
        write_new(folder, like)
    typer.echo(f"{folder}: change {FILE_NAME}, then: robomark assignments check {shlex.quote(str(folder))}")


@assignments_app.command()
def export(
    assignment: Which,
    folder: Annotated[Path, typer.Argument(help="A folder to write into, or a .zip to make.")],
    student: Annotated[
        bool, typer.Option("--student", help="What students get: the task, the starter, the given files.")
    ] = False,
) -> None:
    """Write an assignment out: whole, or with --student what students may see of it."""
    with for_the_user():
        written = export_for_students(assignment, folder) if student else export_whole(assignment, folder)
    typer.echo(f"{folder}: {_count(written, 'file', 'files')}")


@assignments_app.command()
def autograder(
    assignment: Which,
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder to make.")],
) -> None:
    """Make the folder that Gradescope takes as an autograder; it has this installation's secret in it."""
    with for_the_user():
        write_autograder(assignment, output, secret_here(load_settings()))
    typer.echo(f"{output}: zip what is in it, and upload that to Gradescope")


def _console() -> Console:
    """As wide as the terminal; wide enough for every table where there is none."""
    return Console(width=None if Console().is_terminal else _WIDTH_OF_FILES)


def _noted(assignment: str, checked: CheckedAssignment) -> CheckedAssignment:
    """As it is with the new expectations, which are written for somebody to read over."""
    if not checked.unwritten:
        typer.echo(f"{EXPECTED} has a table for every example that could be noted: nothing was written")
        return checked
    with for_the_user():
        path = add_expected(assignment, checked.unwritten)
    typer.echo(f"{path}: wrote what {', '.join(checked.unwritten)} got; is it what they must get?")
    return checked.written()


def _print_checked(checked: CheckedAssignment) -> None:
    found = checked.assignment
    criteria = _count(len(found.criteria), "criterion", "criteria")
    trials = _count(sum(1 for _ in found.trials()), "trial", "trials")
    typer.echo(f"{found.id}: in order; {criteria}, {found.max_marks:g} marks, {trials} (version {found.version[:12]})")
    if checked.examples:
        _console().print(examples_table(checked))
    else:
        typer.echo(f"no examples to grade: expected {EXAMPLES}/{REFERENCE} beside {FILE_NAME}")
    if checked.measures:
        _console().print(measures_table(checked))


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _flowing(text: str) -> str:
    """Paragraphs on one line each, to be broken by whoever shows them; lists and indented lines stay."""
    return re.sub(r"(?<=\S)\n(?=[^\W\d])", " ", text)
