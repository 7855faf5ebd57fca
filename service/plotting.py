"""Plots of a grade; the only module that uses both the floors and the drawing code.

Stores nothing and is independent of the queue; ``store.plots`` stores the plots.
"""

from __future__ import annotations

from service.grading.grade import Grade
from sim.floors.canvas import Pixels
from submissions.assignment.definition import Assignment
from submissions.diagram_cells import read_diagrams
from submissions.submission import Submission


def draw_plots(grade: Grade, assignment: Assignment, submission: Submission) -> dict[str, bytes]:
    """Draw every plot of a grade, with the assignment's own floors and a notebook's diagrams. Maps names to PNG."""
    # Imported here, because a worker does not need it before its first grade.
    from service.reports.plots.grade_plots import draw_all_plots

    return draw_all_plots(grade, load_own_floors(assignment), read_diagrams(submission.notebook).cells)


def load_own_floors(assignment: Assignment) -> dict[str, Pixels]:
    """Return the assignment's own floor by name; empty if it has none."""
    from sim.floors import build_floor_from_image

    world = assignment.world
    if world.image is None:
        return {}
    return {world.background: build_floor_from_image(world.background, world.image).pixels}
