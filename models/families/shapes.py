"""The shape classifier: six shapes of Simple_Shapes as the robot's left light sensor sees them, on the spot and beside.

Labels are the course's codes 0 to 5.
"""

from __future__ import annotations

import itertools

import numpy as np

from models.images import LabelledPose, Photographer, Shift
from models.perceptrons import Perceptron
from models.preprocessing import features
from models.tasks import Examples, Task, Test, register
from sim.chance import Stream
from sim.floors import SHAPES
from sim.recording import Pose

_SEED = 20201107
_OFFSETS = range(-4, 5)  # mm, each way
_NOISES = (0, 0, 16, 32, 64, 96, 128, 128)
_NOISES_ON_THE_SPOT = (32, 64, 96, *[128] * 37)


def places() -> tuple[LabelledPose, ...]:
    """Where the course stands the robot: its left sensor is over the middle of each shape."""
    return tuple(LabelledPose("Simple_Shapes", 0, Pose(200 + 80 * code, 900, 0), code) for code in range(len(SHAPES)))


def _examples() -> Examples:
    """Every shape at every offset, without noise and with several noises; on the spot with more."""
    images, labels = [], []
    with Photographer() as photographer:
        for place, dx, dy in itertools.product(places(), _OFFSETS, _OFFSETS):
            noises = (*_NOISES, *(_NOISES_ON_THE_SPOT if dx == dy == 0 else ()))
            for draw, noise in enumerate(noises):
                name = f"{_SEED}:{place.label}:{dx}:{dy}:{draw}"
                grey = photographer.image(place, Shift(x=dx, y=dy, noise=noise), Stream(0, name).integer(0) >> 1)
                images.append(features(grey))
                labels.append(place.label)
    return np.array(images), np.array(labels, np.int64)


def _test() -> Test:
    noises = ((0, 1), (10, 20), (32, 20), (64, 20), (128, 20))
    words = "the six shapes where the course stands the robot, without noise once, with light noise 10, 32, 64 and 128 "
    words += "twenty times each"
    return Test(places(), noises, places(), (0, 32), 20, words)


TASK = register(
    Task(
        name="shapes",
        file="mlp_shapes_14x14.joblib",
        words="Names the shape under the robot's left light sensor.",
        classes=SHAPES,
        side=14,
        plan=Perceptron(hidden=40, stages=((1e-3, 60), (2e-4, 20)), decay=1e-3, seed=_SEED),
        examples=_examples,
        training_words=f"Simple_Shapes as the simulated left sensor sees it: every whole mm up to {max(_OFFSETS)} off "
        "each way, light noise 0, 16, 32, 64, 96 and 128; on the spot more often with 128",
        test=_test,
    )
)
