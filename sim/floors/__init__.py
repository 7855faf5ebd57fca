"""The printed floors that the robot drives over: what they look like, and what is where on them.

Images only: how a light sensor sees them is the camera's, and what a flag asks for is the flags'.
"""

from sim.backgrounds.drawing import HEIGHT, LABEL_GREYS, WIDTH
from sim.backgrounds.floors import (
    OBSTACLE_PRESETS,
    SEEDED,
    SHAPES,
    Floor,
    FloorLabel,
    floor,
    floor_from_image,
    label_names,
    names,
    start_of,
)

__all__ = [
    "HEIGHT",
    "LABEL_GREYS",
    "OBSTACLE_PRESETS",
    "SEEDED",
    "SHAPES",
    "WIDTH",
    "Floor",
    "FloorLabel",
    "floor",
    "floor_from_image",
    "label_names",
    "names",
    "start_of",
]
