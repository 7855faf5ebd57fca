"""The convolutional network that is fitted here: its gradients, its file, and its reproducible bytes."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from models.convolutions import Convolution
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
from models.networks import load_network
from models.onnx_format import build_onnx_file
from models.perceptrons import Perceptron
from models.tasks import NetworkTrainer

CHANCE = np.random.default_rng(4)


def network() -> list[Layer]:
    layers: list[Layer] = [
        ConvolutionLayer(5, 1, 3, 2, CHANCE),
        MaxPoolingLayer(),
        ReluLayer(),
        ConvolutionLayer(3, 3, 4, 0, CHANCE),
        ReluLayer(),
        FlattenLayer(),
        DenseLayer(3 * 3 * 4, 6, CHANCE),
        ReluLayer(),
        DenseLayer(6, 3, CHANCE),
    ]
    for layer in layers:
        for weights in layer.weights:
            weights += CHANCE.normal(size=weights.shape).astype(np.float32) * 0.1
    return layers


def scores(layers: list[Layer], images: Floats) -> Floats:
    values = images
    for layer in layers:
        values = layer.forward(values)
    return values


def test_slopes_are_what_a_small_step_changes() -> None:
    layers, images = network(), CHANCE.random((4, 10, 10, 1), dtype=np.float32)
    towards = CHANCE.normal(size=(4, 3)).astype(np.float32)
    scores(layers, images)
    slopes = towards
    for layer in reversed(layers):
        slopes = layer.backward(slopes)
    step = 1e-2
    for layer in layers:
        for weights, each in zip(layer.weights, layer.gradients, strict=True):
            way = CHANCE.normal(size=weights.shape).astype(np.float32)
            way /= np.linalg.norm(way)
            start = weights.copy()
            weights[...] = start + step * way
            after = float((scores(layers, images) * towards).sum())
            weights[...] = start - step * way
            before = float((scores(layers, images) * towards).sum())
            weights[...] = start
            assert (after - before) / (2 * step) == pytest.approx(float((each * way).sum()), rel=0.05, abs=0.02)


def test_the_file_answers_as_the_layers_do() -> None:
    layers, images = network(), CHANCE.random((5, 10, 10, 1), dtype=np.float32)
    powers = np.exp(scores(layers, images))
    session = onnxruntime.InferenceSession(build_onnx_file(layers, 10, 3))
    (input_node,) = session.get_inputs()
    assert input_node.shape == ["n", 1, 10, 10]
    (shares,) = session.run(None, {input_node.name: images.transpose(0, 3, 1, 2)})
    assert np.allclose(shares, powers / powers.sum(axis=1, keepdims=True), atol=1e-6)


def test_what_is_forgotten_is_made_up_for_by_the_rest() -> None:
    layer = DropoutLayer(0.25, CHANCE)
    values = layer.forward(np.ones((100, 100), np.float32))
    assert set(np.unique(values)) == {np.float32(0), np.float32(1 / 0.75)}
    assert values.mean() == pytest.approx(1, abs=0.05)
    assert np.array_equal(layer.backward(np.ones((100, 100), np.float32)), values)


def bars() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertical and horizontal bars at random places in 12 x 12 pixels."""
    images = np.zeros((400, 12, 12))
    for number, image in enumerate(images):
        row = CHANCE.integers(12)
        (image if number % 2 else image.T)[row] = 1
    return images.reshape(400, -1), np.arange(400) % 2


@pytest.mark.long
@pytest.mark.parametrize(
    ("file", "plan"),
    [
        ("net.joblib", Perceptron(20, ((1e-2, 30),), 1e-3, 3)),
        ("net.onnx", Convolution((3, 4, 4), 8, passes=50, step=2e-2, decay=0.01, forget=0.2, seed=3)),
    ],
)
def test_fitting_again_gives_the_same_bytes_and_what_is_fitted_has_learnt(file: str, plan: NetworkTrainer) -> None:
    images, labels = bars()
    # One thread, as in training. For so small a network, threads mostly wait for each other.
    with threadpool_limits(1):
        data = plan.fit(images, labels)
        assert plan.fit(images, labels) == data
    assert np.mean(load_network(file, data).predict(images) == labels) >= 0.95
