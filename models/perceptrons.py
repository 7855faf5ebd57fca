"""Reproducible training and export of a multi-layer perceptron.

The training data are defined in ``families/``. ``training.py`` sets up the process so that training again gives the
same bytes.
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
    """Perceptron with one hidden layer, trained in stages of (Adam step size, epochs), saved with joblib."""

    hidden: int
    stages: tuple[tuple[float, int], ...]
    decay: float  # L2 regularisation
    seed: int

    def fit(self, images: Vector, labels: NDArray[np.int64]) -> bytes:
        """Train a network and return it as a file with rounded weights.

        ``images`` has shape (n, inputs); ``labels`` are their class numbers.
        """
        network = MLPClassifier(
            hidden_layer_sizes=(self.hidden,), alpha=self.decay, tol=0, n_iter_no_change=10_000, batch_size=200,
            warm_start=True, random_state=self.seed,
        )  # fmt: skip
        with warnings.catch_warnings():
            # The number of epochs is fixed, so the warning about convergence does not apply.
            warnings.simplefilter("ignore", ConvergenceWarning)
            for step, passes in self.stages:
                network.set_params(learning_rate_init=step, max_iter=passes)
                network.fit(images, labels)
        _finalise_network(network)
        file = io.BytesIO()
        joblib.dump(network, file)
        return file.getvalue()

    def describe_architecture(self, inputs: int, classes: int) -> str:
        """Describe the layers in words."""
        return f"multi-layer perceptron {inputs}-{self.hidden}-{classes}, ReLU, Adam"


def _finalise_network(network: MLPClassifier) -> None:
    """Round the weights to hide differences in the last bits, and remove attributes used only in training."""
    network.coefs_ = [np.ascontiguousarray(np.round(weights, _DECIMALS), np.float32) for weights in network.coefs_]
    network.intercepts_ = [np.round(weights, _DECIMALS).astype(np.float32) for weights in network.intercepts_]
    network.loss_ = network.best_loss_ = round(float(network.loss_), 2)
    network.loss_curve_ = []
    for left_over in ("_optimizer", "_random_state", "_best_coefs", "_best_intercepts"):
        delattr(network, left_over)


def load_perceptron(data: bytes) -> MLPClassifier:
    """Load a network. The hash of the bytes must be on a card; never use it for other files."""
    return joblib.load(io.BytesIO(data))
