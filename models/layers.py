"""Layers of a small convolutional network on numpy: forward pass and gradients.

Values are float32; images have shape (n, height, width, channels). A layer keeps the input of its last ``forward`` call
until ``backward``. ``convolutions.py`` combines the layers and trains them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Floats = NDArray[np.float32]


class Layer(ABC):
    """One layer of a network."""

    weights: tuple[Floats, ...] = ()  # updated in place during training
    gradients: tuple[Floats, ...] = ()  # gradient of the loss for each weight, set by ``backward``

    @abstractmethod
    def forward(self, values: Floats) -> Floats:
        """Return the output of the layer for the input ``values``."""

    @abstractmethod
    def backward(self, slopes: Floats) -> Floats:
        """Return the gradient of the loss at the layer's input, given the gradient at its output."""


class ConvolutionLayer(Layer):
    """Convolution with ``side`` x ``side`` filters and ``margin`` pixels of zero padding."""

    def __init__(self, side: int, channels: int, filters: int, margin: int, chance: Generator) -> None:
        self.side, self.margin = side, margin
        self.weights = _initialise_weights(chance, side * side * channels, filters)

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
        flat_slopes = slopes.reshape(-1, slopes.shape[-1])
        self.gradients = (self._windows.T @ flat_slopes, flat_slopes.sum(axis=0))
        (count, height, width), (_, tall, wide, channels) = self._places, self._shape
        window_slopes = (flat_slopes @ self.weights[0].T).reshape(count, height, width, self.side, self.side, channels)
        padded_slopes = np.zeros((count, tall + 2 * self.margin, wide + 2 * self.margin, channels), np.float32)
        for row in range(self.side):
            for column in range(self.side):
                padded_slopes[:, row : row + height, column : column + width] += window_slopes[:, :, :, row, column]
        return padded_slopes[:, self.margin : self.margin + tall, self.margin : self.margin + wide]


class MaxPoolingLayer(Layer):
    """Max pooling over 2 x 2 pixels. Height and width must be even."""

    def forward(self, values: Floats) -> Floats:
        self._is_upper_larger = values[:, 0::2] >= values[:, 1::2]
        rows = np.maximum(values[:, 0::2], values[:, 1::2])
        self._is_left_larger = rows[:, :, 0::2] >= rows[:, :, 1::2]
        return np.maximum(rows[:, :, 0::2], rows[:, :, 1::2])

    def backward(self, slopes: Floats) -> Floats:
        rows = _route_gradient(slopes, self._is_left_larger, axis=2)
        return _route_gradient(rows, self._is_upper_larger, axis=1)


class ReluLayer(Layer):
    """ReLU activation: negative values become 0."""

    def forward(self, values: Floats) -> Floats:
        self._positive = values > 0
        return values * self._positive

    def backward(self, slopes: Floats) -> Floats:
        return slopes * self._positive


class FlattenLayer(Layer):
    """Flatten each image to a row of numbers."""

    def forward(self, values: Floats) -> Floats:
        self._shape = values.shape
        return values.reshape(len(values), -1)

    def backward(self, slopes: Floats) -> Floats:
        return slopes.reshape(self._shape)


class DropoutLayer(Layer):
    """Dropout with rate ``share``. Used only during training."""

    def __init__(self, share: float, chance: Generator) -> None:
        self._share, self._chance = share, chance

    def forward(self, values: Floats) -> Floats:
        mask = self._chance.random(values.shape, dtype=np.float32) >= self._share
        self._scaled_mask = mask.astype(np.float32) / np.float32(1 - self._share)
        return values * self._scaled_mask

    def backward(self, slopes: Floats) -> Floats:
        return slopes * self._scaled_mask


class DenseLayer(Layer):
    """Fully connected layer."""

    def __init__(self, inputs: int, outputs: int, chance: Generator) -> None:
        self.weights = _initialise_weights(chance, inputs, outputs)

    def forward(self, values: Floats) -> Floats:
        self._values = values
        return np.asarray(values @ self.weights[0] + self.weights[1])

    def backward(self, slopes: Floats) -> Floats:
        self.gradients = (self._values.T @ slopes, slopes.sum(axis=0))
        return np.asarray(slopes @ self.weights[0].T)


def _initialise_weights(chance: Generator, inputs: int, outputs: int) -> tuple[Floats, Floats]:
    """Return initial weights and biases (K. He et al., ICCV 2015, 1026)."""
    weights = chance.standard_normal((inputs, outputs)) * np.sqrt(2 / inputs)
    return weights.astype(np.float32), np.zeros(outputs, np.float32)


def _route_gradient(slopes: Floats, first: NDArray[np.bool_], axis: int) -> Floats:
    """Return the gradient at the larger value of each pair, and 0 at the smaller."""
    pairs = np.stack((slopes * first, slopes * ~first), axis=axis + 1)
    shape = list(slopes.shape)
    shape[axis] *= 2
    return pairs.reshape(shape)
