"""The layers of a small convolutional network on numpy: what they make of images, and the slopes of their weights.

Numbers are float32, images of shape (n, height, width, channels); a layer keeps what its last ``forward`` saw until
``backward``. How many there are and how they are fitted stands in ``convolutions.py``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Floats = NDArray[np.float32]


class Layer(ABC):
    """One step from images to scores."""

    weights: tuple[Floats, ...] = ()  # changed in place while it is fitted
    slopes: tuple[Floats, ...] = ()  # of what is minimised, one a weight, after ``backward``

    @abstractmethod
    def forward(self, values: Floats) -> Floats:
        """What the layer makes of ``values``."""

    @abstractmethod
    def backward(self, slopes: Floats) -> Floats:
        """The slopes of what is minimised at the layer's input, from those at its output."""


class Filters(Layer):
    """Filters of ``side`` x ``side`` at every pixel, with ``margin`` pixels of zeroes round the image."""

    def __init__(self, side: int, channels: int, filters: int, margin: int, chance: Generator) -> None:
        self.side, self.margin = side, margin
        self.weights = _start(chance, side * side * channels, filters)

    def forward(self, values: Floats) -> Floats:
        self._shape = values.shape
        edge = (self.margin, self.margin)
        windows = np.lib.stride_tricks.sliding_window_view(
            np.pad(values, ((0, 0), edge, edge, (0, 0))), (self.side, self.side), axis=(1, 2)
        )
        self._places = windows.shape[:3]
        self._windows = np.ascontiguousarray(windows.transpose(0, 1, 2, 4, 5, 3)).reshape(-1, len(self.weights[0]))
        filters, offsets = self.weights
        return np.asarray(self._windows @ filters + offsets).reshape(*self._places, -1)

    def backward(self, slopes: Floats) -> Floats:
        flat = slopes.reshape(-1, slopes.shape[-1])
        self.slopes = (self._windows.T @ flat, flat.sum(axis=0))
        (count, height, width), (_, tall, wide, channels) = self._places, self._shape
        back = (flat @ self.weights[0].T).reshape(count, height, width, self.side, self.side, channels)
        padded = np.zeros((count, tall + 2 * self.margin, wide + 2 * self.margin, channels), np.float32)
        for row in range(self.side):
            for column in range(self.side):
                padded[:, row : row + height, column : column + width] += back[:, :, :, row, column]
        return padded[:, self.margin : self.margin + tall, self.margin : self.margin + wide]


class Halving(Layer):
    """The largest of each 2 x 2 pixels; height and width are even."""

    def forward(self, values: Floats) -> Floats:
        self._upper = values[:, 0::2] >= values[:, 1::2]
        rows = np.maximum(values[:, 0::2], values[:, 1::2])
        self._left = rows[:, :, 0::2] >= rows[:, :, 1::2]
        return np.maximum(rows[:, :, 0::2], rows[:, :, 1::2])

    def backward(self, slopes: Floats) -> Floats:
        rows = _apart(slopes, self._left, axis=2)
        return _apart(rows, self._upper, axis=1)


class Positive(Layer):
    """What is negative becomes 0 (ReLU)."""

    def forward(self, values: Floats) -> Floats:
        self._positive = values > 0
        return values * self._positive

    def backward(self, slopes: Floats) -> Floats:
        return slopes * self._positive


class Flat(Layer):
    """Each image as one row of numbers."""

    def forward(self, values: Floats) -> Floats:
        self._shape = values.shape
        return values.reshape(len(values), -1)

    def backward(self, slopes: Floats) -> Floats:
        return slopes.reshape(self._shape)


class Forgetting(Layer):
    """Puts ``share`` of the numbers to 0, others each time (dropout); only while the network is fitted."""

    def __init__(self, share: float, chance: Generator) -> None:
        self._share, self._chance = share, chance

    def forward(self, values: Floats) -> Floats:
        kept = self._chance.random(values.shape, dtype=np.float32) >= self._share
        self._kept = kept.astype(np.float32) / np.float32(1 - self._share)
        return values * self._kept

    def backward(self, slopes: Floats) -> Floats:
        return slopes * self._kept


class Dense(Layer):
    """Weighted sums of all numbers of a row."""

    def __init__(self, inputs: int, outputs: int, chance: Generator) -> None:
        self.weights = _start(chance, inputs, outputs)

    def forward(self, values: Floats) -> Floats:
        self._values = values
        return np.asarray(values @ self.weights[0] + self.weights[1])

    def backward(self, slopes: Floats) -> Floats:
        self.slopes = (self._values.T @ slopes, slopes.sum(axis=0))
        return np.asarray(slopes @ self.weights[0].T)


def _start(chance: Generator, inputs: int, outputs: int) -> tuple[Floats, Floats]:
    """Weights and offsets before fitting (K. He et al., ICCV 2015, 1026)."""
    weights = chance.standard_normal((inputs, outputs)) * np.sqrt(2 / inputs)
    return weights.astype(np.float32), np.zeros(outputs, np.float32)


def _apart(slopes: Floats, first: NDArray[np.bool_], axis: int) -> Floats:
    """Each slope where the larger of its two was; 0 where the smaller was."""
    pairs = np.stack((slopes * first, slopes * ~first), axis=axis + 1)
    shape = list(slopes.shape)
    shape[axis] *= 2
    return pairs.reshape(shape)
