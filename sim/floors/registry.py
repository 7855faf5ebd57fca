"""The floors by name: image, default pose, labels and obstacles, as the course's simulator has them.

The drawing itself is in ``drawing.py`` and its neighbours;
what a flag with an unknown name means is decided where flags are read.
"""

from __future__ import annotations

import difflib
import functools
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sim.backgrounds import digits, drawing, mats, tracks
from sim.backgrounds.testcard import testcard
from sim.chance import Stream
from sim.errors import UsageError
from sim.recording import Pose

Obstacle = tuple[float, float, float, float]
_Pixels = Callable[[], NDArray[np.uint8]]

#: What the flag ``-o`` offers: x, y, width, height of each obstacle, mm, lower left corner first.
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
    """Where the left light sensor's centre sees a named thing: lower left corner and size, world mm."""

    label: str
    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        return self.x <= x <= self.x + self.width and self.y <= y <= self.y + self.height


@dataclass(frozen=True, slots=True)
class Floor:
    """A background. ``pixels`` is read-only, shape (1143, 2362, 3); its row 0 is at world y = 1143."""

    name: str
    pixels: NDArray[np.uint8]
    default_pose: Pose
    labels: tuple[FloorLabel, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    label_patches: bool = True  # whether the image shows the grey patches that tell the answer, where it has any
    sheet: int = 0  # the seed of the handwritten digits, on a digit sheet, or of the order of the shapes

    def label_at(self, x: float, y: float) -> str | None:
        """What a left light sensor with its centre at (x, y) mm sees, if that has a name."""
        return next((label.label for label in self.labels if label.holds(x, y)), None)


@dataclass(frozen=True, slots=True)
class _Plan:
    pose: Pose
    pixels: _Pixels
    unlabelled: _Pixels | None = None
    labels: tuple[FloorLabel, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()


@dataclass(frozen=True, slots=True)
class _ShapesPlan:
    """The shapes of Simple_Shapes at their places, in another order for each seed."""

    pose: Pose


@dataclass(frozen=True, slots=True)
class _SheetPlan:
    pose: Pose
    paper: int


def _painted(painter: drawing.Painter, background: drawing.Colour = drawing.WHITE) -> Callable[[], NDArray[np.uint8]]:
    return functools.partial(drawing.paint, painter, background)


def _shape_labels(
    upper: Sequence[int] = drawing.UPPER_ROW, lower: Sequence[int] = drawing.LOWER_ROW
) -> tuple[FloorLabel, ...]:
    """Within 10 mm of where the course stands the left sensor: the shape is then inside the sensor's view."""
    return tuple(
        FloorLabel(SHAPES[code], 230.0 + 80 * column - 10, y - 10, 20.0, 20.0)
        for y, codes in ((920.0, upper), (720.0, lower))
        for column, code in enumerate(codes)
    )


@functools.lru_cache(maxsize=8)
def _shuffled_shapes(name: str, plan: _ShapesPlan, labels: bool, seed: int) -> Floor:
    """Each shape once in the upper row, in an order that the seed draws, and any four in the lower.

    It is not one of the course's: where the robot stands must not tell what it sees.
    """
    chance = Stream(seed, "shapes")
    upper = sorted(drawing.UPPER_ROW, key=chance.integer)
    lower = [chance.integer(100 + column) % len(SHAPES) for column in range(len(drawing.LOWER_ROW))]
    rows = functools.partial(drawing.shape_rows, upper=upper, lower=lower, label_patches=labels)
    pixels = _read_only(drawing.paint(rows, drawing.WHITE))
    return Floor(name, pixels, plan.pose, _shape_labels(upper, lower), label_patches=labels, sheet=seed)


def _digit_labels(shown: tuple[int, ...]) -> tuple[FloorLabel, ...]:
    """Within 10 mm of where the course stands the left sensor, digit by digit as the sheet gives them."""
    places = (divmod(place, digits.COLUMNS) for place in range(len(shown)))
    return tuple(
        FloorLabel(str(digit), 80.0 + digits.PITCH * column - 10, 1080.0 - digits.PITCH * row - 10, 20.0, 20.0)
        for digit, (row, column) in zip(shown, places, strict=True)
    )


_PLANS: Mapping[str, _Plan | _SheetPlan | _ShapesPlan] = MappingProxyType(
    {
        "Empty_Map": _Plan(Pose(100, 800, 0), _painted(drawing.nothing)),
        "Loop": _Plan(Pose(500, 500, 90), _painted(drawing.loop)),
        "Two_shapes": _Plan(Pose(200, 500, 90), _painted(drawing.two_shapes)),
        "Grey_bands": _Plan(Pose(150, 500, 0), _painted(drawing.grey_bands)),
        "Linear_grey": _Plan(Pose(200, 50, 90), drawing.linear_grey),
        "Radial_grey": _Plan(Pose(100, 400, 0), lambda: drawing.radial(inner=drawing.WHITE, outer=drawing.BLACK)),
        "Radial_red": _Plan(Pose(100, 400, 0), lambda: drawing.radial(inner=(255, 80, 80), outer=(80, 0, 0))),
        "Coloured_bands": _Plan(Pose(100, 800, 0), _painted(drawing.coloured_bands)),
        "Rainbow_bands": _Plan(Pose(100, 800, 0), _painted(drawing.rainbow_bands)),
        "Grey_and_black": _Plan(Pose(400, 700, 90), _painted(drawing.grey_and_black)),
        "Lollipop": _Plan(Pose(750, 375, -180), _painted(drawing.lollipop, drawing.grey(211))),
        "Testcard": _Plan(Pose(400, 800, 90), testcard),
        "Square": _Plan(Pose(550, 300, -90), _painted(drawing.square)),
        "WRO_2019_Regular_Junior": _Plan(Pose(2215, 150, 90), mats.wro_2019_regular_junior),
        "WRO_2018_Regular_Junior": _Plan(Pose(1181, 150, 90), mats.wro_2018_regular_junior),
        "FLL_2019_City_Shaper": _Plan(Pose(500, 150, 90), mats.fll_2019_city_shaper),
        "FLL_2018_Into_Orbit": _Plan(Pose(150, 150, 90), mats.fll_2018_into_orbit),
        "Line_Following_Test": _Plan(Pose(141, 125, 90), tracks.line_following_test),
        "Junction_Handling_Test": _Plan(Pose(698, 130, 90), tracks.junction_handling_test),
        "Sensor_Diameter_Test": _Plan(Pose(550, 450, 90), _painted(drawing.sensor_diameter_test)),
        "Simple_Shapes": _Plan(
            Pose(800, 400, 0),
            _painted(drawing.simple_shapes_with_labels),
            _painted(drawing.simple_shapes),
            _shape_labels(),
        ),
        "Thruxton_Circuit": _Plan(Pose(457, 242, 120), tracks.thruxton_circuit),
        "MNIST_Digits": _SheetPlan(Pose(400, 50, 90), paper=255),
        "MNIST_Digits_Black": _SheetPlan(Pose(400, 50, 90), paper=0),
        "Obstacles_Test": _Plan(Pose(121, 125, 90), tracks.obstacles_test, obstacles=_TEST_OBSTACLES),
        "Shuffled_Shapes": _ShapesPlan(Pose(800, 400, 0)),
    }
)

#: The floors that each seed draws anew.
SEEDED = tuple(name for name, plan in _PLANS.items() if isinstance(plan, _SheetPlan | _ShapesPlan))


def names() -> tuple[str, ...]:
    """Every floor that ``floor`` knows, in the order of the course's menu."""
    return tuple(_PLANS)


def floor(name: str, *, labels: bool = True, seed: int = 0) -> Floor:
    """The floor called ``name``; with ``labels=False`` drawn without the grey patches that tell the answer.

    Each ``seed`` gives another digit sheet, and another order of the shapes on Shuffled_Shapes; on the other floors
    it changes nothing.
    Raises UsageError for a name that no floor has, and offers the names nearest to it.
    """
    plan = _PLANS.get(name)
    if plan is None:
        raise UsageError(f"There is no background called {name!r}; {_suggestion(name)}")
    if isinstance(plan, _SheetPlan):
        return _digit_sheet(name, plan, labels, seed)
    if isinstance(plan, _ShapesPlan):
        return _shuffled_shapes(name, plan, labels, seed)
    return _printed(name, plan, labels)


@functools.lru_cache(maxsize=12)  # an image is 8 MB, and flags can ask for every floor there is
def _printed(name: str, plan: _Plan, labels: bool) -> Floor:
    draw = plan.pixels if labels or plan.unlabelled is None else plan.unlabelled
    return Floor(name, _read_only(draw()), plan.pose, plan.labels, plan.obstacles, label_patches=labels)


@functools.lru_cache(maxsize=4)  # a worker sees ever new seeds
def _digit_sheet(name: str, plan: _SheetPlan, labels: bool, seed: int) -> Floor:
    sheet = digits.draw_sheet(seed, plan.paper, label_patches=labels)
    return Floor(
        name, _read_only(sheet.pixels), plan.pose, _digit_labels(sheet.digits), label_patches=labels, sheet=seed
    )


def start_of(name: str) -> tuple[Pose, tuple[Obstacle, ...]]:
    """The default pose and the obstacles of the floor called ``name``, without drawing it.

    Raises UsageError for a name that no floor has.
    """
    plan = _PLANS.get(name)
    if plan is None:
        raise UsageError(f"There is no background called {name!r}; {_suggestion(name)}")
    return plan.pose, plan.obstacles if isinstance(plan, _Plan) else ()


def label_names(name: str) -> tuple[str, ...]:
    """Every label that the floor called ``name`` can have, in the course's order; none for an unknown name."""
    plan = _PLANS.get(name)
    if isinstance(plan, _SheetPlan):
        return tuple(map(str, range(10)))
    if isinstance(plan, _ShapesPlan):
        return SHAPES
    return tuple(dict.fromkeys(label.label for label in plan.labels)) if plan is not None else ()


def floor_from_image(name: str, data: bytes, default_pose: Pose = Pose(200, 800, 0)) -> Floor:  # noqa: B008
    """A floor of the instructor's own, from the bytes of a PNG or JPEG file of 2362 x 1143 pixels.

    Raises UsageError when the bytes are no such image. See-through parts show white.
    """
    try:
        with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
            if image.size != (drawing.WIDTH, drawing.HEIGHT):
                raise UsageError(
                    f"The background image {name!r} is {image.width} x {image.height} pixels; "
                    f"it must be {drawing.WIDTH} x {drawing.HEIGHT}, one a millimetre."
                )
            paper = Image.new("RGBA", image.size, (255, 255, 255, 255))
            pixels = np.asarray(Image.alpha_composite(paper, image.convert("RGBA")).convert("RGB"))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UsageError(f"The background image {name!r} cannot be read as PNG or JPEG.") from error
    return Floor(name, _read_only(pixels), default_pose)


def _suggestion(name: str) -> str:
    """The end of a sentence that names the floors nearest to ``name``, or all."""
    by_lower = {known.lower(): known for known in _PLANS}
    near = difflib.get_close_matches(name.lower(), by_lower, n=3, cutoff=0.5)
    if near:
        return "did you mean " + " or ".join(by_lower[match] for match in near) + "?"
    return "there are " + ", ".join(_PLANS) + "."


def _read_only(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    fixed = np.ascontiguousarray(pixels)
    fixed.setflags(write=False)
    return fixed
