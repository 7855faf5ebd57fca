"""Floors that the robot drives over: images, labels and obstacles.

Each module that draws a floor registers it. Light sensors see floors through ``camera.py``; the flags of magics that
select a floor are parsed elsewhere.
"""

from sim.discovery import import_all
from sim.floors.canvas import HEIGHT, WIDTH
from sim.floors.registry import (
    OBSTACLE_PRESETS,
    Floor,
    FloorLabel,
    build_floor,
    build_floor_from_image,
    get_floor_start,
    list_floor_names,
    list_label_names,
    list_seeded_floor_names,
)
from sim.floors.shapes import LABEL_GREYS, SHAPES

import_all(__name__, __path__)

__all__ = [
    "HEIGHT",
    "LABEL_GREYS",
    "OBSTACLE_PRESETS",
    "SHAPES",
    "WIDTH",
    "Floor",
    "FloorLabel",
    "build_floor",
    "build_floor_from_image",
    "get_floor_start",
    "list_floor_names",
    "list_label_names",
    "list_seeded_floor_names",
]
