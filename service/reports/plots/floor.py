"""Drawing of a floor: the image with a scale in mm, the start pose, obstacles and labelled places.

The images come from ``sim/floors``. ``path.py`` draws a robot's path over a floor.
"""

from __future__ import annotations

import numpy as np
from matplotlib.markers import MarkerStyle
from PIL import Image

from service.reports.display_text import format_heading, format_whole_number
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.floor_image import FLOOR_HEIGHT, FLOOR_WIDTH
from service.reports.plots.panel import Panel
from service.reports.plots.style import FAULT, HEAD, RULE, WIDTH
from sim.floors import Floor

_LEFT_EDGE, _RIGHT_EDGE, _FOOT = 0.56, 0.12, 0.42  # inches


def draw_floor(floor: Floor) -> Drawing:
    """Draw the whole floor with x to the right and y upwards, mm."""
    width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    height = width * FLOOR_HEIGHT / FLOOR_WIDTH
    pose = floor.default_pose
    subtitle = (
        f"start ({format_whole_number(pose.x)}, {format_whole_number(pose.y)}) heading {format_heading(pose.heading)}°"
    )
    names = tuple(dict.fromkeys(label.label for label in floor.labels))
    if names:
        subtitle += f"; {len(floor.labels)} labelled places, {len(names)} labels"
    drawing = create_drawing(HEAD + height + _FOOT, floor.name, subtitle)
    panel = Panel(drawing, Rectangle(_LEFT_EDGE, _FOOT, width, height), (0, FLOOR_WIDTH), (0, FLOOR_HEIGHT))
    pixels = Image.fromarray(np.ascontiguousarray(floor.pixels[:, :, :3])).reduce(2)
    panel.add_picture(np.asarray(pixels), 0, 0, FLOOR_WIDTH, FLOOR_HEIGHT)
    for x, y, obstacle_width, obstacle_height in floor.obstacles:
        panel.add_rectangle((x, y), obstacle_width, obstacle_height, fill=RULE, edge=Stroke("black", 0.8))
    start = MarkerStyle((3, 0, pose.heading - 90))  # a triangle
    panel.add_marks([(pose.x, pose.y)], start, 9, fill=FAULT, edge=Stroke("white", 1))
    panel.add_frame()
    panel.add_x_axis(label="x, mm")
    panel.add_y_axis(label="y, mm")
    return drawing
