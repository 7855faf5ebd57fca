"""The floors that the robot drives over: what they look like, and what is where on them.

Images only: how a light sensor sees them is the camera's, and what a flag asks for is the flags'.
Every module here that draws a floor registers it itself.
"""

from sim.discovery import import_all
from sim.floors.canvas import HEIGHT, WIDTH
from sim.floors.registry import (
    OBSTACLE_PRESETS,
    Floor,
    FloorLabel,
    floor,
    floor_from_image,
    label_names,
    names,
    seeded_names,
    start_of,
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
    "floor",
    "floor_from_image",
    "label_names",
    "names",
    "seeded_names",
    "start_of",
]
