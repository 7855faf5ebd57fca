"""Registry of floors by name, each with its start pose, labels and obstacles.

Each module that draws a floor registers it here. The code that reads flags decides how to treat unknown names.
"""

from __future__ import annotations

import difflib
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np
from PIL import Image

from sim.errors import UsageError
from sim.floors.canvas import HEIGHT, WIDTH, Pixels
from sim.readers.raster_image import read_image
from sim.readers.reader_errors import UnreadableDataError
from sim.recording import Pose

Obstacle = tuple[float, float, float, float]

#: Limit of all kept images of a process. Each takes 8 MB.
_MAX_CACHED_BYTES = 65_000_000

#: Obstacles for each value of the flag ``-o``: x, y, width, height in mm, lower left corner first.
OBSTACLE_PRESETS: Mapping[str, tuple[Obstacle, ...]] = MappingProxyType(
    {
        "None": (),
        "Central_post": ((900, 500, 200, 200),),
        "Square_posts": (
            (500, 200, 100, 100),
            (500, 700, 100, 100),
            (1500, 200, 100, 100),
            (1500, 700, 100, 100),
        ),
        "Wall": ((1500, 200, 200, 800),),
    }
)


@dataclass(frozen=True, slots=True)
class FloorLabel:
    """Area of the left sensor's centre in which it sees a named object: lower left corner and size, world mm."""

    label: str
    x: float
    y: float
    width: float
    height: float

    def contains_point(self, x: float, y: float) -> bool:
        """Return whether the point (world mm) is inside the label, edges included."""
        return self.x <= x <= self.x + self.width and self.y <= y <= self.y + self.height


@dataclass(frozen=True, slots=True)
class Floor:
    """A floor. ``pixels`` is read-only, shape (1143, 2362, 3); its row 0 is at world y = 1143."""

    name: str
    pixels: Pixels
    default_pose: Pose
    labels: tuple[FloorLabel, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    label_patches: bool = True  # the image shows the grey patches that encode the answers, if the floor has them
    sheet: int = 0  # the seed of the handwritten digits of a digit sheet, or of the order of the shapes

    def find_label(self, x: float, y: float) -> str | None:
        """Return the label at the position (x, y) of the left sensor's centre in mm, if any."""
        return next((label.label for label in self.labels if label.contains_point(x, y)), None)


Drawing = tuple[Pixels, tuple[FloorLabel, ...]]
_Draw = Callable[[], Pixels]


class _DrawFromSeed(Protocol):
    """Function that draws the floor for a seed, with or without the patches that encode the answers."""

    def __call__(self, seed: int, /, *, label_patches: bool) -> Drawing: ...


@dataclass(frozen=True, slots=True)
class _FloorDefinition:
    name: str
    pose: Pose
    menu: int | None  # position in the course's menu, from 1; None for floors outside the course
    label_names: tuple[str, ...]
    obstacles: tuple[Obstacle, ...]
    seeded: bool
    draw: _DrawFromSeed


_DEFINITIONS: dict[str, _FloorDefinition] = {}


def register_floor(
    name: str,
    pose: Pose,
    *,
    menu: int | None = None,
    labels: tuple[FloorLabel, ...] = (),
    obstacles: tuple[Obstacle, ...] = (),
    unlabelled: _Draw | None = None,
) -> Callable[[_Draw], _Draw]:
    """Return a decorator that registers the drawn floor; ``unlabelled`` draws it without the label patches."""

    def register(draw: _Draw) -> _Draw:
        def drawing(_seed: int, *, label_patches: bool) -> Drawing:
            return (draw if label_patches or unlabelled is None else unlabelled)(), labels

        label_names = tuple(dict.fromkeys(label.label for label in labels))
        _register(_FloorDefinition(name, pose, menu, label_names, obstacles, False, drawing))
        return draw

    return register


def register_seeded_floor(
    name: str, pose: Pose, *, menu: int | None = None, label_names: tuple[str, ...]
) -> Callable[[_DrawFromSeed], _DrawFromSeed]:
    """Return a decorator that registers a floor drawn for each seed, with labels from ``list_label_names``."""

    def register(draw: _DrawFromSeed) -> _DrawFromSeed:
        _register(_FloorDefinition(name, pose, menu, label_names, (), True, draw))
        return draw

    return register


def _register(plan: _FloorDefinition) -> None:
    if plan.name in _DEFINITIONS:
        raise ValueError(f"there are two floors called {plan.name}")
    _DEFINITIONS[plan.name] = plan


def list_floor_names() -> tuple[str, ...]:
    """Return the names of all floors: the course's in the order of its menu, then the others in alphabetical order."""
    return tuple(
        sorted(_DEFINITIONS, key=lambda name: (_DEFINITIONS[name].menu is None, _DEFINITIONS[name].menu or 0, name))
    )


def list_seeded_floor_names() -> tuple[str, ...]:
    """Return the names of the floors that depend on a seed."""
    return tuple(name for name in list_floor_names() if _DEFINITIONS[name].seeded)


def build_floor(name: str, *, labels: bool = True, seed: int = 0) -> Floor:
    """Return the floor called ``name``; with ``labels=False`` without the grey patches that encode the answers.

    On floors that depend on a seed, ``seed`` decides the positions of the objects. Other floors ignore it.

    Raises:
        UsageError: No floor has this name. The message suggests similar names.
    """
    return _build_floor(name, labels, seed if _get_definition(name).seeded else 0)


# A notebook can select every floor, and a worker receives new seeds all the time.
@functools.lru_cache(maxsize=_MAX_CACHED_BYTES // (WIDTH * HEIGHT * 3))
def _build_floor(name: str, labels: bool, seed: int) -> Floor:
    plan = _get_definition(name)
    pixels, floor_labels = plan.draw(seed, label_patches=labels)
    return Floor(plan.name, _make_read_only(pixels), plan.pose, floor_labels, plan.obstacles, labels, seed)


def get_floor_start(name: str) -> tuple[Pose, tuple[Obstacle, ...]]:
    """Return the default pose and the obstacles of the floor called ``name``, without drawing it.

    Raises:
        UsageError: No floor has this name.
    """
    plan = _get_definition(name)
    return plan.pose, plan.obstacles


def list_label_names(name: str) -> tuple[str, ...]:
    """Return all possible labels of the floor called ``name``, in the course's order; empty for an unknown name."""
    return _DEFINITIONS[name].label_names if name in _DEFINITIONS else ()


def build_floor_from_image(name: str, data: bytes) -> Floor:
    """Return a floor made from an instructor's PNG or JPEG file of 2362 x 1143 pixels.

    Transparent parts become white.

    Raises:
        UsageError: The bytes are not such an image.
    """
    try:
        image = read_image(data, WIDTH, HEIGHT)
    except UnreadableDataError as error:
        raise UsageError(
            f"The background image {name!r} cannot be used: {error}; "
            f"it must be a PNG or JPEG of {WIDTH} x {HEIGHT} pixels, one a millimetre."
        ) from error
    paper = Image.new("RGBA", image.size, (255, 255, 255, 255))
    pixels = np.asarray(Image.alpha_composite(paper, image).convert("RGB"))
    return Floor(name, _make_read_only(pixels), Pose(200, 800, 0))


def _get_definition(name: str) -> _FloorDefinition:
    if name not in _DEFINITIONS:
        raise UsageError(f"There is no background called {name!r}; {_suggest_floors(name)}")
    return _DEFINITIONS[name]


def _suggest_floors(name: str) -> str:
    """Return the end of an error message that suggests floors similar to ``name``, or lists all floors."""
    by_lower = {known.lower(): known for known in list_floor_names()}
    matches = difflib.get_close_matches(name.lower(), by_lower, n=3, cutoff=0.5)
    if matches:
        return "did you mean " + " or ".join(by_lower[match] for match in matches) + "?"
    return "there are " + ", ".join(list_floor_names()) + "."


def _make_read_only(pixels: Pixels) -> Pixels:
    contiguous_pixels = np.ascontiguousarray(pixels)
    contiguous_pixels.setflags(write=False)
    return contiguous_pixels
