"""Task sheet: the parts of an assignment that students may read.

It has the task, the visible criteria, the files to submit and the given files. Pages, the API and exported folders all
use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal

from submissions.assignment.definition import Assignment
from submissions.submission import PART_FILES, SECOND_PROGRAM


@dataclass(frozen=True, slots=True)
class TaskSheet:
    """An assignment for students. ``more_marks`` is the sum for criteria that are not visible."""

    id: str
    title: str
    section: str
    description: str
    asked: tuple[str, ...]  # files, by name
    notebook: bool  # one notebook can replace all files
    criteria: tuple[tuple[str, Decimal], ...]
    max_marks: Decimal  # of the visible criteria
    more_marks: Decimal
    background: str
    robot: str
    seconds: float | None  # of the longest visible trial
    given: Mapping[str, bytes]  # names and contents


def build_task_sheet(assignment: Assignment) -> TaskSheet:
    """Return the task sheet. Criteria that are not visible contribute only to ``more_marks``."""
    visible_criteria = tuple((each.title, each.marks) for each in assignment.criteria if each.visibility == "visible")
    marks = sum((marks for _, marks in visible_criteria), Decimal(0))
    seconds = [each.seconds for each in assignment.scenarios if each.visibility == "visible"]
    return TaskSheet(
        assignment.id,
        assignment.title,
        assignment.section,
        assignment.description.strip(),
        _list_required_files(assignment),
        assignment.training is None and assignment.world.robots == 1,
        visible_criteria,
        marks,
        assignment.max_marks - marks,
        assignment.world.background,
        assignment.world.robot,
        max(seconds, default=None),
        assignment.given,
    )


def _list_required_files(assignment: Assignment) -> tuple[str, ...]:
    parts = assignment.parts
    files = {PART_FILES["program"]: parts.program, SECOND_PROGRAM: parts.second_program}
    files |= {PART_FILES["responder"]: parts.responder}
    files |= {f"{name}.py": who for name, who in parts.agents.items()}
    return tuple(name for name, who in files.items() if who == "student")
