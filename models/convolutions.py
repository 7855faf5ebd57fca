"""Reproducible training and export of a small convolutional network.

The training data are defined in ``families/``. ``training.py`` sets up the process so that training again gives the
same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from models.layers import (
    ConvolutionLayer,
    DenseLayer,
    DropoutLayer,
    FlattenLayer,
    Floats,
    Layer,
    MaxPoolingLayer,
    ReluLayer,
)
from models.onnx_format import build_onnx_file
from models.preprocessing import Vector

_DECIMALS = 4
_BATCH = 100
_WARM_UP = 200  # number of warm-up steps before the full step size
#: Decay rates of Adam's moving averages: gradient and squared gradient.
_MEAN, _SQUARE = 0.9, 0.999


@dataclass(frozen=True, slots=True)
class Convolution:
    """Convolutional network with three filter layers, a hidden layer and an output layer, saved as ONNX.

    The filters are 5 x 5 (followed by 2 x 2 max pooling), 3 x 3 and 3 x 3.
    """

    filters: tuple[int, int, int]
    hidden: int
    passes: int
    step: float  # maximum step size of Adam; it falls to 0 along a cosine
    decay: float  # weight decay per unit of step size
    forget: float  # dropout rate before the hidden layer
    seed: int

    def fit(self, images: Vector, labels: NDArray[np.int64]) -> bytes:
        """Train a network and return it as a file with rounded weights.

        ``images`` has shape (n, inputs); ``labels`` are their class numbers.
        """
        chance = np.random.default_rng(self.seed)
        side, classes = math.isqrt(images.shape[1]), int(labels.max()) + 1
        layers = self._build_layers(side, classes, chance)
        descent = _AdamOptimizer([weights for layer in layers for weights in layer.weights], self.decay)
        inputs = images.astype(np.float32).reshape(-1, side, side, 1)
        steps = self.passes * (len(inputs) // _BATCH)
        for number in range(steps):
            batch_index = number % (len(inputs) // _BATCH)
            if batch_index == 0:
                order = chance.permutation(len(inputs))
            rows = order[batch_index * _BATCH : (batch_index + 1) * _BATCH]
            _compute_gradients(layers, inputs[rows], labels[rows])
            size = self.step * (1 + math.cos(math.pi * number / steps)) / 2 * min(1.0, (number + 1) / _WARM_UP)
            descent.step([slopes for layer in layers for slopes in layer.gradients], size)
        for layer in layers:
            for weights in layer.weights:
                # Rounding hides differences in the last bits.
                weights[...] = np.round(weights, _DECIMALS)
        return build_onnx_file(layers, side, classes)

    def describe_architecture(self, inputs: int, classes: int) -> str:
        """Describe the layers in words."""
        side = math.isqrt(inputs)
        first, second, third = self.filters
        return (
            f"convolutional network {side} x {side}: {first} filters of 5 x 5, the largest of 2 x 2, {second} and "
            f"{third} filters of 3 x 3, {self.hidden}-{classes}, ReLU, Adam"
        )

    def _build_layers(self, side: int, classes: int, chance: Generator) -> tuple[Layer, ...]:
        first, second, third = self.filters
        half = side // 2
        return (
            ConvolutionLayer(5, 1, first, 2, chance),
            MaxPoolingLayer(),
            ReluLayer(),
            ConvolutionLayer(3, first, second, 1, chance),
            ReluLayer(),
            ConvolutionLayer(3, second, third, 0, chance),
            ReluLayer(),
            FlattenLayer(),
            DropoutLayer(self.forget, chance),
            DenseLayer((half - 2) ** 2 * third, self.hidden, chance),
            ReluLayer(),
            DenseLayer(self.hidden, classes, chance),
        )


class _AdamOptimizer:
    """Adam (D. Kingma, J. Ba, ICLR 2015) with weight decay (I. Loshchilov, F. Hutter, ICLR 2019)."""

    def __init__(self, weights: Sequence[Floats], decay: float) -> None:
        self._weights, self._decay, self._steps = weights, decay, 0
        self._means = [np.zeros_like(each) for each in weights]
        self._squares = [np.zeros_like(each) for each in weights]

    def step(self, slopes: Sequence[Floats], size: float) -> None:
        """Update each weight by one step along the negative gradients in ``slopes``."""
        self._steps += 1
        corrected_size = size * math.sqrt(1 - _SQUARE**self._steps) / (1 - _MEAN**self._steps)
        for weights, slope, mean, square in zip(self._weights, slopes, self._means, self._squares, strict=True):
            mean += (1 - _MEAN) * (slope - mean)
            square += (1 - _SQUARE) * (slope * slope - square)
            if weights.ndim > 1:
                weights *= 1 - size * self._decay
            weights -= corrected_size * mean / (np.sqrt(square) + 1e-8)


def _compute_gradients(layers: Sequence[Layer], images: Floats, labels: NDArray[np.int64]) -> None:
    """Compute the gradients of the mean softmax cross entropy over ``images`` and store them in each layer."""
    values = images
    for layer in layers:
        values = layer.forward(values)
    powers = np.exp(values - values.max(axis=1, keepdims=True))
    slopes = powers / powers.sum(axis=1, keepdims=True)
    slopes[np.arange(len(labels)), labels] -= 1
    slopes /= np.float32(len(labels))
    for layer in reversed(layers):
        slopes = layer.backward(slopes)
