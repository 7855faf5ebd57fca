"""The plots of a grade against its assignment: the one place that knows both the floors and the drawing.

Keeps nothing and knows no queue; what is drawn is kept by ``store.plots``.
"""

from __future__ import annotations

from service.grading.grade import Grade
from sim.floors.canvas import Pixels
from submissions.assignment.definition import Assignment
from submissions.diagram_cells import diagrams_in
from submissions.submission import Submission


def draw(grade: Grade, assignment: Assignment, submission: Submission) -> dict[str, bytes]:
    """Every plot of the grade, name -> PNG; floors of the assignment's own, and a notebook's diagrams, as such."""
    # A worker need not load it before its first grade.
    from service.reports.plots.drawn import draw_all

    return draw_all(grade, own_floors(assignment), diagrams_in(submission.notebook).cells)


def own_floors(assignment: Assignment) -> dict[str, Pixels]:
    """The floor of the assignment's own, by its name, if it has one."""
    from sim.floors import floor_from_image

    world = assignment.world
    if world.image is None:
        return {}
    return {world.background: floor_from_image(world.background, world.image).pixels}
