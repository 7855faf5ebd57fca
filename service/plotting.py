"""Plots of a grade; the only module that uses both the floors and the drawing code.

Stores nothing and is independent of the queue; ``store.plots`` stores the plots.
"""

from __future__ import annotations

from service.grading.grade import Grade
from sim.floors.canvas import Pixels
from submissions.assignment.definition import Assignment
from submissions.diagram_cells import diagrams_in
from submissions.submission import Submission


def draw(grade: Grade, assignment: Assignment, submission: Submission) -> dict[str, bytes]:
    """Draw every plot of a grade, with the assignment's own floors and a notebook's diagrams. Maps names to PNG."""
    # Imported here, because a worker does not need it before its first grade.
    from service.reports.plots.drawn import draw_all

    return draw_all(grade, own_floors(assignment), diagrams_in(submission.notebook).cells)


def own_floors(assignment: Assignment) -> dict[str, Pixels]:
    """Return the assignment's own floor by name; empty if it has none."""
    from sim.floors import floor_from_image

    world = assignment.world
    if world.image is None:
        return {}
    return {world.background: floor_from_image(world.background, world.image).pixels}
