"""Fitting a multi-layer perceptron and writing it down, so that training again gives the same bytes.

What it is trained on is the business of ``families/``; the process is set up by ``training.py``.
"""

from __future__ import annotations

import io
import warnings

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier

from models.preprocessing import Vector
from models.tasks import Plan

_DECIMALS = 4


def fit(plan: Plan, images: Vector, labels: NDArray[np.int64]) -> MLPClassifier:
    """A network for ``images`` of shape (n, inputs) and their class numbers, its weights rounded."""
    network = MLPClassifier(
        hidden_layer_sizes=(plan.hidden,), alpha=plan.decay, tol=0, n_iter_no_change=10_000, batch_size=200,
        warm_start=True, random_state=plan.seed,
    )  # fmt: skip
    with warnings.catch_warnings():
        # The passes are counted out; that the loss might fall further is no news.
        warnings.simplefilter("ignore", ConvergenceWarning)
        for step, passes in plan.stages:
            network.set_params(learning_rate_init=step, max_iter=passes)
            network.fit(images, labels)
    _settle(network)
    return network


def _settle(network: MLPClassifier) -> None:
    """Round the weights, so that last bits do not show, and drop what only the fitting needs."""
    network.coefs_ = [np.ascontiguousarray(np.round(weights, _DECIMALS), np.float32) for weights in network.coefs_]
    network.intercepts_ = [np.round(weights, _DECIMALS).astype(np.float32) for weights in network.intercepts_]
    network.loss_ = network.best_loss_ = round(float(network.loss_), 2)
    network.loss_curve_ = []
    for left_over in ("_optimizer", "_random_state", "_best_coefs", "_best_intercepts"):
        delattr(network, left_over)


def written(network: MLPClassifier) -> bytes:
    """The network as joblib writes it."""
    file = io.BytesIO()
    joblib.dump(network, file)
    return file.getvalue()


def read(data: bytes) -> MLPClassifier:
    """A network from bytes whose hash stands on a card; never for anybody else's."""
    return joblib.load(io.BytesIO(data))


def architecture(plan: Plan, inputs: int, classes: int) -> str:
    """The layers in words."""
    return f"multi-layer perceptron {inputs}-{plan.hidden}-{classes}, ReLU, Adam"
