"""The plots of a grade against its assignment: the one place that knows both the floors and the drawing.

Keeps nothing and knows no queue; what is drawn is kept by ``store.plots``.
"""

from __future__ import annotations

from service.grading.grade import Grade
from submissions.assignment.definition import Assignment
from submissions.diagram_cells import diagrams_in
from submissions.submission import Submission


def draw(grade: Grade, assignment: Assignment, submission: Submission) -> dict[str, bytes]:
    """Every plot of the grade, name -> PNG; floors of the assignment's own, and a notebook's diagrams, as such."""
    # A worker that only grades need not load the drawing library.
    from service.reports.plots.drawn import draw_all
    from sim.floors import floor_from_image

    world = assignment.world
    images = {}
    if world.image is not None:
        images[world.background] = floor_from_image(world.background, world.image).pixels
    return draw_all(grade, images, diagrams_in(submission.notebook).cells)
