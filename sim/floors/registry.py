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
from sim.readers.unreadable import Unreadable
from sim.recording import Pose

Obstacle = tuple[float, float, float, float]

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

    def holds(self, x: float, y: float) -> bool:
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

    def label_at(self, x: float, y: float) -> str | None:
        """Return the label at the position (x, y) of the left sensor's centre in mm, if any."""
        return next((label.label for label in self.labels if label.holds(x, y)), None)


Drawing = tuple[Pixels, tuple[FloorLabel, ...]]
_Draw = Callable[[], Pixels]


class _DrawAnew(Protocol):
    """Function that draws the floor for a seed, with or without the patches that encode the answers."""

    def __call__(self, seed: int, /, *, label_patches: bool) -> Drawing: ...


@dataclass(frozen=True, slots=True)
class _Plan:
    name: str
    pose: Pose
    menu: int | None  # position in the course's menu, from 1; None for floors outside the course
    label_names: tuple[str, ...]
    obstacles: tuple[Obstacle, ...]
    seeded: bool
    draw: _DrawAnew


_PLANS: dict[str, _Plan] = {}


def printed(
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

        named = tuple(dict.fromkeys(label.label for label in labels))
        _add(_Plan(name, pose, menu, named, obstacles, False, drawing))
        return draw

    return register


def drawn_anew(
    name: str, pose: Pose, *, menu: int | None = None, label_names: tuple[str, ...]
) -> Callable[[_DrawAnew], _DrawAnew]:
    """Return a decorator that registers a floor drawn for each seed, with labels from ``label_names``."""

    def register(draw: _DrawAnew) -> _DrawAnew:
        _add(_Plan(name, pose, menu, label_names, (), True, draw))
        return draw

    return register


def _add(plan: _Plan) -> None:
    if plan.name in _PLANS:
        raise ValueError(f"there are two floors called {plan.name}")
    _PLANS[plan.name] = plan


def names() -> tuple[str, ...]:
    """Return the names of all floors: the course's in the order of its menu, then the others in alphabetical order."""
    return tuple(sorted(_PLANS, key=lambda name: (_PLANS[name].menu is None, _PLANS[name].menu or 0, name)))


def seeded_names() -> tuple[str, ...]:
    """Return the names of the floors that depend on a seed."""
    return tuple(name for name in names() if _PLANS[name].seeded)


def floor(name: str, *, labels: bool = True, seed: int = 0) -> Floor:
    """Return the floor called ``name``; with ``labels=False`` without the grey patches that encode the answers.

    On floors that depend on a seed, ``seed`` decides the positions of the objects. Other floors ignore it.

    Raises:
        UsageError: No floor has this name. The message suggests similar names.
    """
    return _seeded(name, labels, seed) if _plan(name).seeded else _printed(name, labels)


@functools.lru_cache(maxsize=12)  # an image takes 8 MB, and flags can select every floor
def _printed(name: str, labels: bool) -> Floor:
    return _floor(_plan(name), labels, 0)


@functools.lru_cache(maxsize=12)  # a worker receives new seeds all the time
def _seeded(name: str, labels: bool, seed: int) -> Floor:
    return _floor(_plan(name), labels, seed)


def _floor(plan: _Plan, labels: bool, seed: int) -> Floor:
    pixels, found = plan.draw(seed, label_patches=labels)
    return Floor(plan.name, _read_only(pixels), plan.pose, found, plan.obstacles, labels, seed)


def start_of(name: str) -> tuple[Pose, tuple[Obstacle, ...]]:
    """Return the default pose and the obstacles of the floor called ``name``, without drawing it.

    Raises:
        UsageError: No floor has this name.
    """
    plan = _plan(name)
    return plan.pose, plan.obstacles


def label_names(name: str) -> tuple[str, ...]:
    """Return all possible labels of the floor called ``name``, in the course's order; empty for an unknown name."""
    return _PLANS[name].label_names if name in _PLANS else ()


def floor_from_image(name: str, data: bytes, default_pose: Pose = Pose(200, 800, 0)) -> Floor:  # noqa: B008
    """Return a floor made from an instructor's PNG or JPEG file of 2362 x 1143 pixels.

    Transparent parts become white.

    Raises:
        UsageError: The bytes are not such an image.
    """
    try:
        image = read_image(data, WIDTH, HEIGHT)
    except Unreadable as error:
        raise UsageError(
            f"The background image {name!r} cannot be used: {error}; "
            f"it must be a PNG or JPEG of {WIDTH} x {HEIGHT} pixels, one a millimetre."
        ) from error
    paper = Image.new("RGBA", image.size, (255, 255, 255, 255))
    pixels = np.asarray(Image.alpha_composite(paper, image).convert("RGB"))
    return Floor(name, _read_only(pixels), default_pose)


def _plan(name: str) -> _Plan:
    if name not in _PLANS:
        raise UsageError(f"There is no background called {name!r}; {_suggestion(name)}")
    return _PLANS[name]


def _suggestion(name: str) -> str:
    """Return the end of an error message that suggests floors similar to ``name``, or lists all floors."""
    by_lower = {known.lower(): known for known in names()}
    near = difflib.get_close_matches(name.lower(), by_lower, n=3, cutoff=0.5)
    if near:
        return "did you mean " + " or ".join(by_lower[match] for match in near) + "?"
    return "there are " + ", ".join(names()) + "."


def _read_only(pixels: Pixels) -> Pixels:
    fixed = np.ascontiguousarray(pixels)
    fixed.setflags(write=False)
    return fixed
