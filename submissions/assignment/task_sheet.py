"""What students may read of an assignment: the task, the visible criteria, what to submit, and the given files.

The one place that decides it; pages, the API and exported folders lay it out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal

from submissions.assignment.definition import Assignment
from submissions.submission import PART_FILES, SECOND_PROGRAM


@dataclass(frozen=True, slots=True)
class TaskSheet:
    """An assignment for students. ``more_marks`` are for what is marked and not told."""

    id: str
    title: str
    section: str
    description: str
    asked: tuple[str, ...]  # files, by name
    notebook: bool  # whether one notebook will do for all that is asked
    criteria: tuple[tuple[str, Decimal], ...]
    max_marks: Decimal  # of these
    more_marks: Decimal
    background: str
    robot: str
    seconds: float | None  # of the longest trial that is shown
    given: Mapping[str, bytes]  # their names and what is in them


def task_sheet(assignment: Assignment) -> TaskSheet:
    """Of what is not visible to students it says only that there is more."""
    shown = tuple((each.title, each.marks) for each in assignment.criteria if each.visibility == "visible")
    marks = sum((marks for _, marks in shown), Decimal(0))
    seconds = [each.seconds for each in assignment.scenarios if each.visibility == "visible"]
    return TaskSheet(
        assignment.id,
        assignment.title,
        assignment.section,
        assignment.description.strip(),
        _asked(assignment),
        assignment.training is None and assignment.world.robots == 1,
        shown,
        marks,
        assignment.max_marks - marks,
        assignment.world.background,
        assignment.world.robot,
        max(seconds, default=None),
        assignment.given,
    )


def _asked(assignment: Assignment) -> tuple[str, ...]:
    parts = assignment.parts
    files = {PART_FILES["program"]: parts.program, SECOND_PROGRAM: parts.second_program}
    files |= {PART_FILES["responder"]: parts.responder}
    files |= {f"{name}.py": who for name, who in parts.agents.items()}
    return tuple(name for name, who in files.items() if who == "student")
