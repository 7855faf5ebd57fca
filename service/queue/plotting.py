"""The plots of a grade as files to keep: the one place where the queue meets the drawing.

Draws nothing itself.
"""

from __future__ import annotations

from service.grading.grade import Grade
from service.store.artifacts import File
from submissions.assignment.definition import Assignment

PREFIX = "plot-"


def draw(grade: Grade, assignment: Assignment) -> list[File]:
    """Every plot of the grade, named ``plot-<name>.png``; floors of the assignment's own are drawn as such."""
    # A worker that only grades need not load the drawing library.
    from service.reports.plots import draw_all
    from sim.backgrounds import floor_from_image

    world = assignment.world
    images = {}
    if world.image is not None:
        images[world.background] = floor_from_image(world.background, world.image).pixels
    return [File(f"{PREFIX}{name}.png", "image/png", data) for name, data in draw_all(grade, images).items()]
