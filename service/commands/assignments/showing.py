"""``robomark assignments show``: the task of one assignment and its criteria."""

from __future__ import annotations

from typing import TYPE_CHECKING

from service.commands.assignments.arguments import AssignmentArgument, format_count
from service.commands.output import create_table, print_json, print_line
from service.commands.output import print_renderables as show_parts

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment


def show(assignment: AssignmentArgument) -> None:
    """Show the task of an assignment and its marking scheme."""
    from rich.text import Text

    from service.reports.display_text import join_wrapped_lines, to_display_text, to_one_line
    from submissions.assignment.reader import find_assignment

    found = find_assignment(assignment)
    trials = {each.id: sum(trial.scenario is each for trial in found.trials()) for each in found.scenarios}
    print_json(**_assignment_to_json(found, trials))
    title = Text(to_one_line(found.title), style="bold")
    show_parts(title.append(f" ({found.id}), {found.max_marks:g} marks", style="not bold"))
    if found.description:
        show_parts(Text(join_wrapped_lines(to_display_text(found.description.strip(), 20_000, lines=500))))
    show_parts(f"\n{_describe_setting(found)}")
    if found.given:
        show_parts(f"given files: {', '.join(sorted(found.given))}")
    criteria = create_table("criterion", "check", "marks", right=("marks",))
    for criterion in found.criteria:
        criteria.add_row(to_one_line(criterion.title), criterion.check, f"{criterion.marks:g}")
    show_parts(criteria)
    for scenario in found.scenarios:
        counted = format_count(trials[scenario.id], "trial", "trials")
        print_line(f"scenario {scenario.id}: {counted} of at most {scenario.seconds:g} s, {scenario.visibility}")


def _assignment_to_json(found: Assignment, trials: dict[str, int]) -> dict[str, object]:
    """Return the JSON value for an assignment."""
    return {
        "id": found.id,
        "title": found.title,
        "section": found.section,
        "description": found.description,
        "version": found.version,
        "marks": found.max_marks,
        "background": found.world.background,
        "robot": found.world.robot,
        "program": found.parts.program,
        "responder": found.parts.responder,
        "given": sorted(found.given),
        "criteria": [
            {"id": each.id, "title": each.title, "check": each.check, "marks": each.marks} for each in found.criteria
        ],
        "scenarios": [
            {"id": each.id, "trials": trials[each.id], "seconds": each.seconds, "visibility": each.visibility}
            for each in found.scenarios
        ],
    }


def _describe_cell(which: str) -> str:
    """Describe which notebook cell contains the marked robot program."""
    if which.isdecimal():
        return f"robot program {which}"
    return "the last robot program" if which == "last" else f'the cell tagged "{which.removeprefix("tag:")}"'


def _describe_setting(found: Assignment) -> str:
    if not found.scenarios:
        return f"no robot is run; responder: {found.parts.responder}"
    agents = "".join(f", {name}: {who}" for name, who in found.parts.agents.items())
    noise = "" if found.world.noise == "course" else f", motor noise in {found.world.noise}"
    return (
        f"world: {found.world.background}, robot {found.world.robot}{noise}; "
        f"program: {found.parts.program}, responder: {found.parts.responder}{agents}; "
        f"of a notebook: {_describe_cell(found.parts.cell)}"
    )
