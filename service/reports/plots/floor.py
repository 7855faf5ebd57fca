"""Drawing of a floor: the image with a scale in mm, the start pose, obstacles and labelled places.

The images come from ``sim/floors``. ``path.py`` draws a robot's path over a floor.
"""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from service.reports.display_text import format_heading, format_whole_number
from service.reports.plots.style import FAULT, HEAD, RULE, WIDTH, add_axes, create_figure, load_font
from sim.floors import Floor

_FLOOR_WIDTH, _FLOOR_HEIGHT = 2362, 1143  # mm
_LEFT_EDGE, _RIGHT_EDGE, _FOOT = 0.56, 0.12, 0.42  # inches


def draw_floor(floor: Floor) -> Figure:
    """Draw the whole floor with x to the right and y upwards, mm."""
    width = WIDTH - _LEFT_EDGE - _RIGHT_EDGE
    height = width * _FLOOR_HEIGHT / _FLOOR_WIDTH
    pose = floor.default_pose
    subtitle = (
        f"start ({format_whole_number(pose.x)}, {format_whole_number(pose.y)}) heading {format_heading(pose.heading)}°"
    )
    names = tuple(dict.fromkeys(label.label for label in floor.labels))
    if names:
        subtitle += f"; {len(floor.labels)} labelled places, {len(names)} labels"
    figure = create_figure(HEAD + height + _FOOT, floor.name, subtitle)
    axes = add_axes(figure, _LEFT_EDGE, _FOOT, width, height)
    axes.imshow(floor.pixels[:, :, :3], extent=(0, _FLOOR_WIDTH, 0, _FLOOR_HEIGHT), interpolation="antialiased")
    for x, y, obstacle_width, obstacle_height in floor.obstacles:
        axes.add_patch(
            Rectangle((x, y), obstacle_width, obstacle_height, facecolor=RULE, edgecolor="black", linewidth=0.8)
        )
    axes.plot(pose.x, pose.y, marker=(3, 0, pose.heading - 90), color=FAULT, markersize=9, markeredgecolor="white")
    axes.set_xlim(0, _FLOOR_WIDTH)
    axes.set_ylim(0, _FLOOR_HEIGHT)
    axes.set_xlabel("x, mm", font=load_font(8.5), labelpad=1)
    axes.set_ylabel("y, mm", font=load_font(8.5), labelpad=1)
    return figure
