"""The shape classifier: what the robot's left light sensor sees of six shapes, and the network trained on it.

Training is repeatable to the byte on any processor; ``training.py`` starts it in a process set up for that.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.neural_network import MLPClassifier

from models.cards import Card, Condition
from sim.backgrounds import SHAPES, floor
from sim.camera import BulletCamera
from sim.chance import Stream
from sim.recording import SENSOR_SIDE, Pose
from sim.robot import LightSensor
from sim.sensors import LightReader, Look

FILE = "mlp_shapes_14x14.joblib"
#: In the order of the course's codes 0 to 5.
CLASSES = SHAPES
SEED = 20201107

_HIDDEN = 40
_FOCUS = slice(3, 17)  # the part of the 20 x 20 pixels that lies inside the round window
_OFFSETS = range(-3, 4)  # mm, each way
_TRAINING_NOISES = (0, 0, 16, 32, 64, 96, 128)
_TEST_NOISES = (0, 10, 32, 64, 128)
_TEST_DRAWS = 20
_DECIMALS = 4

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Example:
    """One image: 196 values, 0 to 1, and the class it shows."""

    values: Vector
    label: int


def sensor_pose(shape: int) -> Pose:
    """Where the robot stands when its left sensor is over the middle of ``shape``, as in the course."""
    return Pose(200 + 80 * shape, 900, 0)


class ShapeSource:
    """Images of the shapes as the left sensor sees them, at any offset and noise."""

    def __init__(self) -> None:
        self._camera = BulletCamera(floor("Simple_Shapes").picture)

    def close(self) -> None:
        self._camera.close()

    def image(self, shape: int, dx: int, dy: int, noise: float, seed: int) -> Vector:
        """The 14 x 14 focus, greyscale, divided by its maximum, as the course's predictor has it; shape (196,)."""
        pose = sensor_pose(shape)
        x, y = pose.x + 30 + dx, pose.y + 20 + dy
        radius = SENSOR_SIDE // 2
        where = Look(int(x) - radius, 1143 - int(y) - radius, x, y)
        reader = LightReader(LightSensor(-20, 30), self._camera, noise, Stream(seed, "left light"))
        rgba = np.frombuffer(reader.image(where, 1), np.uint8).reshape(SENSOR_SIDE, SENSOR_SIDE, 4)
        return preprocess(rgba[_FOCUS, _FOCUS, :3])


def preprocess(rgb: NDArray[np.uint8]) -> Vector:
    """Luma (ITU-R 601-2, as Pillow's mode L) of 14 x 14 x 3 pixels, divided by the brightest, flat."""
    weights = np.array([19595, 38470, 7471], np.int64)
    luma = (rgb.astype(np.int64) @ weights + 0x8000) >> 16
    return np.asarray(luma.ravel() / max(int(luma.max()), 1), np.float64)


def training_examples(source: ShapeSource, seed: int) -> Iterator[Example]:
    """Every shape at every offset up to 3 mm each way, clean and at several noises."""
    places = itertools.product(range(len(CLASSES)), _OFFSETS, _OFFSETS, enumerate(_TRAINING_NOISES))
    for shape, dx, dy, (draw, noise) in places:
        name = f"{seed}:{shape}:{dx}:{dy}:{draw}"
        yield Example(source.image(shape, dx, dy, noise, _number(name)), shape)


def train(seed: int = SEED) -> tuple[bytes, Card]:
    """The weights file and its card. Call it through ``training.train``: the bytes depend on the process's set-up."""
    source = ShapeSource()
    try:
        examples = list(training_examples(source, seed))
        network = MLPClassifier(hidden_layer_sizes=(_HIDDEN,), max_iter=500, tol=1e-5, random_state=seed % 2**32)
        network.fit(np.array([each.values for each in examples]), [each.label for each in examples])
        _settle(network)
        file = io.BytesIO()
        joblib.dump(network, file)
        conditions, confusion = evaluate(network, source)
    finally:
        source.close()
    return file.getvalue(), _card(file.getvalue(), len(examples), seed, conditions, confusion)


def _settle(network: MLPClassifier) -> None:
    """Round the weights and drop the optimiser's state, so that last-bit differences between processors do not show."""
    network.coefs_ = [np.ascontiguousarray(np.round(weights, _DECIMALS)) for weights in network.coefs_]
    network.intercepts_ = [np.round(weights, _DECIMALS) for weights in network.intercepts_]
    network.loss_ = network.best_loss_ = round(float(network.loss_), 2)
    network.loss_curve_ = []
    del network._optimizer, network._random_state


def evaluate(network: MLPClassifier, source: ShapeSource) -> tuple[tuple[Condition, ...], tuple[tuple[int, ...], ...]]:
    """How often the network is right at noises and offsets that it has not seen so, and who is taken for whom."""
    confusion = np.zeros((len(CLASSES), len(CLASSES)), np.int64)
    conditions = []
    wanted: list[tuple[str, list[tuple[int, int]], float, int]] = [
        (f"light noise {noise}, on the spot", [(0, 0)], noise, 1 if noise == 0 else _TEST_DRAWS)
        for noise in _TEST_NOISES
    ]
    for reach in (1, 2, 3):
        ring = [(dx, dy) for dx in range(-reach, reach + 1) for dy in range(-reach, reach + 1)]
        ring = [(dx, dy) for dx, dy in ring if max(abs(dx), abs(dy)) == reach]
        wanted += [(f"{reach} mm off, light noise {noise}", ring, noise, 1 if noise == 0 else 5) for noise in (0, 32)]
    for name, offsets, noise, draws in wanted:
        right = n = 0
        for shape, (dx, dy), draw in itertools.product(range(len(CLASSES)), offsets, range(draws)):
            image = source.image(shape, dx, dy, noise, _number(f"test:{name}:{shape}:{dx}:{dy}:{draw}"))
            answer = int(network.predict(image.reshape(1, -1))[0])
            confusion[shape, answer] += 1
            right += answer == shape
            n += 1
        conditions.append(Condition(name, right, n))
    return tuple(conditions), tuple(tuple(int(count) for count in row) for row in confusion)


def _number(name: str) -> int:
    return Stream(0, name).integer(0) >> 1


def _card(
    data: bytes, images: int, seed: int, conditions: tuple[Condition, ...], confusion: tuple[tuple[int, ...], ...]
) -> Card:
    import hashlib
    from importlib.metadata import version

    return Card(
        name="shapes",
        file=FILE,
        task="Names the shape under the robot's left light sensor.",
        architecture=f"multi-layer perceptron 196-{_HIDDEN}-{len(CLASSES)}, ReLU, adam",
        preprocessing="crop (3,3,17,17) of 20 x 20 pixels, greyscale, divided by the maximum, flattened",
        training_data="Simple_Shapes as the simulated left sensor sees it: up to 3 mm off each way, light noise "
        + ", ".join(str(noise) for noise in sorted(set(_TRAINING_NOISES))),
        training_images=images,
        seed=seed,
        classes=CLASSES,
        conditions=conditions,
        confusion=confusion,
        libraries={name: version(name) for name in ("joblib", "numpy", "scikit-learn")},
        sha256=hashlib.sha256(data).hexdigest(),
    )
