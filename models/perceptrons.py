"""Fitting a multi-layer perceptron and writing it down, so that training again gives the same bytes.

What it is trained on is the business of ``families/``; the process is set up by ``training.py``.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass

import joblib
import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier

from models.preprocessing import Vector

_DECIMALS = 4


@dataclass(frozen=True, slots=True)
class Perceptron:
    """One hidden layer, fitted in stages of (step size of Adam, passes over all images); a joblib file."""

    hidden: int
    stages: tuple[tuple[float, int], ...]
    decay: float  # the weight of the squared weights in what is minimised
    seed: int

    def fit(self, images: Vector, labels: NDArray[np.int64]) -> bytes:
        """The file of a network for ``images`` of shape (n, inputs) and their class numbers, its weights rounded."""
        network = MLPClassifier(
            hidden_layer_sizes=(self.hidden,), alpha=self.decay, tol=0, n_iter_no_change=10_000, batch_size=200,
            warm_start=True, random_state=self.seed,
        )  # fmt: skip
        with warnings.catch_warnings():
            # The passes are counted out; that the loss might fall further is no news.
            warnings.simplefilter("ignore", ConvergenceWarning)
            for step, passes in self.stages:
                network.set_params(learning_rate_init=step, max_iter=passes)
                network.fit(images, labels)
        _settle(network)
        file = io.BytesIO()
        joblib.dump(network, file)
        return file.getvalue()

    def architecture(self, inputs: int, classes: int) -> str:
        """The layers in words."""
        return f"multi-layer perceptron {inputs}-{self.hidden}-{classes}, ReLU, Adam"


def _settle(network: MLPClassifier) -> None:
    """Round the weights, so that last bits do not show, and drop what only the fitting needs."""
    network.coefs_ = [np.ascontiguousarray(np.round(weights, _DECIMALS), np.float32) for weights in network.coefs_]
    network.intercepts_ = [np.round(weights, _DECIMALS).astype(np.float32) for weights in network.intercepts_]
    network.loss_ = network.best_loss_ = round(float(network.loss_), 2)
    network.loss_curve_ = []
    for left_over in ("_optimizer", "_random_state", "_best_coefs", "_best_intercepts"):
        delattr(network, left_over)


def read(data: bytes) -> MLPClassifier:
    """A network from bytes whose hash stands on a card; never for anybody else's."""
    return joblib.load(io.BytesIO(data))
