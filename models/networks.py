"""Loading of packaged networks from the files that their cards describe, for every supported library.

Training is in ``perceptrons.py`` and ``convolutions.py``.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from models.preprocessing import Vector


class Network(Protocol):
    """A network that can be evaluated."""

    def predict(self, images: Vector) -> NDArray[np.int64]:
        """Return the predicted class number of each row."""
        ...


def load_network(file: str, data: bytes) -> Network:
    """Load the network in ``file``. The hash of the file must be on a card; never use it for other files."""
    if file.endswith(".onnx"):
        return _OnnxSession(data)
    from models import perceptrons

    network: Network = perceptrons.load_perceptron(data)
    return network


class _OnnxSession:
    def __init__(self, data: bytes) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session: Any = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])

    def predict(self, images: Vector) -> NDArray[np.int64]:
        (input_node,) = self._session.get_inputs()
        (shares,) = self._session.run(
            None, {input_node.name: images.astype(np.float32).reshape(-1, *input_node.shape[1:])}
        )
        return np.asarray(shares.argmax(axis=1), np.int64)
