"""Shape classifier for the six shapes of Simple_Shapes, seen by the left light sensor on the spot and beside it.

Labels are the course's codes 0 to 5. The training data also contain shapes as instructors' own images may show them:
rotated, scaled, paler or partly covered.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from models.images import LabelledPose, Photographer, Shift
from models.perceptrons import Perceptron
from models.preprocessing import SIDE, Grey, add_noise, compute_features
from models.tasks import AlterationTest, ClassifierTest, Examples, Task, register
from sim.floors import SHAPES
from sim.random_streams import RandomStream
from sim.recording import Pose

_SEED = 20201107
_OFFSETS = range(-4, 5)  # mm in each direction
_NOISES = (0, 0, 16, 32, 64, 96, 128, 128)
_NOISES_ON_THE_SPOT = (32, 64, 96, *[128] * 37)
_ROUNDS = 2
#: Images of shapes as in instructors' own images: the number per shape and the range of each alteration.
_ALTERED_IMAGES_PER_SHAPE = 8000
_ALTERED_IMAGE_NOISES = (0, 0, 0, 32, 64, 128)
_BLACK, _WHITE, _PALEST = 0, 255, 90
_MARGIN = 18  # white pixels added round a shape, visible after a rotation
_RESAMPLINGS = (Image.Resampling.NEAREST, Image.Resampling.BILINEAR, Image.Resampling.BICUBIC)
#: Test conditions for these images.
_TURNS = tuple(float(degrees) for degrees in range(-30, 31, 5))
_SIZES = tuple(float(percent) for percent in range(50, 141, 10))
_COVERS = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0)


def list_shape_poses() -> tuple[LabelledPose, ...]:
    """Return the course's poses, which put the left sensor over the middle of each shape."""
    return tuple(LabelledPose("Simple_Shapes", 0, Pose(200 + 80 * code, 900, 0), code) for code in range(len(SHAPES)))


@dataclass(frozen=True, slots=True)
class Alteration:
    """Alteration of a shape: rotation (anticlockwise) and scale about the window's middle, offset, ink and cover."""

    turned: float = 0.0  # degrees
    scale: float = 1.0
    x: float = 0.0  # mm to the right
    y: float = 0.0  # mm upwards
    ink: int = _BLACK
    resampling: Image.Resampling = Image.Resampling.NEAREST
    cover: tuple[int, int, int, int, int] | None = None  # left, top, width and height in pixels, and the grey level


def render_altered_shape(code: int, alteration: Alteration) -> Grey:
    """Return the grey focus over a shape with this alteration, shape (14, 14)."""
    shape = np.full((SIDE + 2 * _MARGIN, SIDE + 2 * _MARGIN), _WHITE, np.uint8)
    shape[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN] = _render_printed_shapes()[code]
    angle = math.radians(alteration.turned)
    cosine, sine = math.cos(angle) / alteration.scale, math.sin(angle) / alteration.scale
    x, y = SIDE / 2 + alteration.x, SIDE / 2 - alteration.y
    middle = _MARGIN + SIDE / 2
    # Inverse mapping from output to input pixels. It keeps the centre, apart from the move.
    inverse = (cosine, -sine, middle - cosine * x + sine * y, sine, cosine, middle - sine * x - cosine * y)
    rotated_image = Image.fromarray(shape).transform(
        (SIDE, SIDE), Image.Transform.AFFINE, inverse, alteration.resampling, fillcolor=_WHITE
    )
    grey = alteration.ink + np.asarray(rotated_image, np.int64) * (_WHITE - alteration.ink) // _WHITE
    if alteration.cover is not None:
        left, top, width, height, colour = alteration.cover
        grey[top : top + height, left : left + width] = colour
    return grey.astype(np.uint8)


@functools.cache
def _render_printed_shapes() -> tuple[Grey, ...]:
    """Return the focus over each shape of Simple_Shapes at the course's poses."""
    with Photographer() as photographer:
        return tuple(photographer.take_image(place, Shift()) for place in list_shape_poses())


def _build_examples() -> Examples:
    """Return the training images: the course's floor ``_ROUNDS`` times, then altered shapes."""
    images, labels = _build_floor_examples()
    altered_shapes = [
        (code, _build_altered_example(code, number))
        for code in range(len(SHAPES))
        for number in range(_ALTERED_IMAGES_PER_SHAPE)
    ]
    rows = np.array([compute_features(grey) for _, grey in altered_shapes])
    return (
        np.concatenate([images] * _ROUNDS + [rows]),
        np.concatenate([labels] * _ROUNDS + [np.array([code for code, _ in altered_shapes], np.int64)]),
    )


def _build_floor_examples() -> Examples:
    """Return every shape at every offset, with and without noise. The shapes on the spot occur more often."""
    images, labels = [], []
    with Photographer() as photographer:
        for place, dx, dy in itertools.product(list_shape_poses(), _OFFSETS, _OFFSETS):
            noises = (*_NOISES, *(_NOISES_ON_THE_SPOT if dx == dy == 0 else ()))
            for draw, noise in enumerate(noises):
                name = f"{_SEED}:{place.label}:{dx}:{dy}:{draw}"
                grey = photographer.take_image(
                    place, Shift(x=dx, y=dy, noise=noise), RandomStream(0, name).integer(0) >> 1
                )
                images.append(compute_features(grey))
                labels.append(place.label)
    return np.array(images), np.array(labels, np.int64)


def _build_altered_example(code: int, number: int) -> Grey:
    """Return an altered training image of a shape; large rotations get small offsets.

    A triangle rotated by 30 degrees looks like another shape apart from its position.
    """
    chance = RandomStream(_SEED, f"own image {code}")
    kind = chance.uniform(number, 0)
    if kind < 0.35:
        turn, smallest, largest, reach = 22.0, 0.75, 1.15, 0.5
    elif kind < 0.75:
        turn, smallest, largest, reach = 13.0, 0.55, 1.3, 2.0
    else:
        turn, smallest, largest, reach = 0.0, 1.0, 1.0, 3.0
    has_cover = kind >= 0.75 or chance.uniform(number, 1) < 0.35
    grey = render_altered_shape(
        code,
        Alteration(
            turned=chance.between(-turn, turn, number, 2),
            scale=chance.between(smallest, largest, number, 3),
            x=chance.between(-reach, reach, number, 4),
            y=chance.between(-reach, reach, number, 5),
            ink=chance.integer(number, 6) % _PALEST if chance.uniform(number, 7) < 0.3 else _BLACK,
            resampling=_RESAMPLINGS[chance.integer(number, 8) % len(_RESAMPLINGS)],
            cover=_choose_cover(chance, number) if has_cover else None,
        ),
    )
    noise = _ALTERED_IMAGE_NOISES[chance.integer(number, 9) % len(_ALTERED_IMAGE_NOISES)]
    return add_noise(grey, noise, RandomStream(_SEED, f"own noise {code}"), number) if noise else grey


def _choose_cover(chance: RandomStream, number: int) -> tuple[int, int, int, int, int]:
    width, height = (2 + chance.integer(number, index) % 6 for index in (10, 11))
    left, top = (chance.integer(number, index) % (SIDE - side + 1) for index, side in ((12, width), (13, height)))
    colour = (_BLACK, _WHITE, chance.integer(number, 14) % (_WHITE + 1))[chance.integer(number, 15) % 3]
    return left, top, width, height, colour


def _render_turned_shapes(degrees: float) -> Iterator[tuple[int, Grey]]:
    yield from _render_alterations(lambda resampling: [Alteration(turned=degrees, resampling=resampling)])


def _render_scaled_shapes(percent: float) -> Iterator[tuple[int, Grey]]:
    moves = tuple(itertools.product((-1, 0, 1), repeat=2))
    yield from _render_alterations(
        lambda resampling: [Alteration(scale=percent / 100, x=x, y=y, resampling=resampling) for x, y in moves]
    )


def _render_covered_shapes(side: float) -> Iterator[tuple[int, Grey]]:
    """Yield the shapes covered by a black, grey or white square at every position in their 10 x 10 pixels."""
    width = int(side)
    corners = range(2, 2 + 10 - width + 1)
    for code in range(len(SHAPES)):
        for left, top, colour in itertools.product(corners, corners, (_BLACK, 128, _WHITE)):
            yield code, render_altered_shape(code, Alteration(cover=(left, top, width, width, colour)))


def _render_alterations(
    build_alterations: Callable[[Image.Resampling], Sequence[Alteration]],
) -> Iterator[tuple[int, Grey]]:
    for code in range(len(SHAPES)):
        for resampling in (Image.Resampling.NEAREST, Image.Resampling.BILINEAR):
            for alteration in build_alterations(resampling):
                yield code, render_altered_shape(code, alteration)


def _build_test() -> ClassifierTest:
    noises = ((0, 1), (10, 20), (32, 20), (64, 20), (128, 20))
    description = (
        "the six shapes where the course stands the robot, without noise once, with light noise 10, 32, 64 and 128 "
    )
    description += "twenty times each"
    curves = (
        AlterationTest("turned image", "degrees", "about the window's middle", _TURNS, _render_turned_shapes),
        AlterationTest("size of the image", "%", "on the spot and 1 mm beside", _SIZES, _render_scaled_shapes),
        AlterationTest(
            "covered square", "mm each way", "black, grey or white, wherever it is", _COVERS, _render_covered_shapes
        ),
    )
    return ClassifierTest(list_shape_poses(), noises, list_shape_poses(), (0, 32), 20, description, curves)


TASK = register(
    Task(
        name="shapes",
        file="mlp_shapes_14x14.joblib",
        words="Names the shape under the robot's left light sensor.",
        classes=SHAPES,
        side=14,
        plan=Perceptron(hidden=150, stages=((1e-3, 30), (2e-4, 10)), decay=1e-3, seed=_SEED),
        examples=_build_examples,
        training_words=f"Simple_Shapes as the simulated left sensor sees it: every whole mm up to {max(_OFFSETS)} off "
        "each way, light noise 0, 16, 32, 64, 96 and 128; on the spot more often with 128; and as an image of one's "
        "own may have them: turned up to 22 degrees, of 55 to 130 %, paler, covered up to 7 x 7 mm, beside the spot",
        test=_build_test,
    )
)
