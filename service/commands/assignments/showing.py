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

    definition = find_assignment(assignment)
    trials = {each.id: sum(trial.scenario is each for trial in definition.trials()) for each in definition.scenarios}
    print_json(**_assignment_to_json(definition, trials))
    title = Text(to_one_line(definition.title), style="bold")
    show_parts(title.append(f" ({definition.id}), {definition.max_marks:g} marks", style="not bold"))
    if definition.description:
        show_parts(Text(join_wrapped_lines(to_display_text(definition.description.strip(), 20_000, lines=500))))
    show_parts(f"\n{_describe_setting(definition)}")
    if definition.given:
        show_parts(f"given files: {', '.join(sorted(definition.given))}")
    criteria = create_table("criterion", "check", "marks", right=("marks",))
    for criterion in definition.criteria:
        criteria.add_row(to_one_line(criterion.title), criterion.check, f"{criterion.marks:g}")
    show_parts(criteria)
    for scenario in definition.scenarios:
        trial_count = format_count(trials[scenario.id], "trial", "trials")
        print_line(f"scenario {scenario.id}: {trial_count} of at most {scenario.seconds:g} s, {scenario.visibility}")


def _assignment_to_json(assignment: Assignment, trials: dict[str, int]) -> dict[str, object]:
    """Return the JSON value for an assignment."""
    return {
        "id": assignment.id,
        "title": assignment.title,
        "section": assignment.section,
        "description": assignment.description,
        "version": assignment.version,
        "marks": assignment.max_marks,
        "background": assignment.world.background,
        "robot": assignment.world.robot,
        "program": assignment.parts.program,
        "responder": assignment.parts.responder,
        "given": sorted(assignment.given),
        "criteria": [
            {"id": each.id, "title": each.title, "check": each.check, "marks": each.marks}
            for each in assignment.criteria
        ],
        "scenarios": [
            {"id": each.id, "trials": trials[each.id], "seconds": each.seconds, "visibility": each.visibility}
            for each in assignment.scenarios
        ],
    }


def _describe_cell(cell_selector: str) -> str:
    """Describe which notebook cell contains the marked robot program."""
    if cell_selector.isdecimal():
        return f"robot program {cell_selector}"
    return (
        "the last robot program"
        if cell_selector == "last"
        else f'the cell tagged "{cell_selector.removeprefix("tag:")}"'
    )


def _describe_setting(assignment: Assignment) -> str:
    if not assignment.scenarios:
        return f"no robot is run; responder: {assignment.parts.responder}"
    agents = "".join(f", {name}: {who}" for name, who in assignment.parts.agents.items())
    noise = "" if assignment.world.noise == "course" else f", motor noise in {assignment.world.noise}"
    return (
        f"world: {assignment.world.background}, robot {assignment.world.robot}{noise}; "
        f"program: {assignment.parts.program}, responder: {assignment.parts.responder}{agents}; "
        f"of a notebook: {_describe_cell(assignment.parts.cell)}"
    )
