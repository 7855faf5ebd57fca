"""A network from the file that its card describes, whichever library its family is written for.

Fitting one is the business of ``perceptrons.py`` and ``convolutions.py``.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from models.preprocessing import Vector


class Network(Protocol):
    """What can be measured."""

    def predict(self, images: Vector) -> NDArray[np.int64]:
        """The class number of each row."""
        ...


def read(file: str, data: bytes) -> Network:
    """The network in the bytes of ``file``, whose hash stands on a card; never for anybody else's."""
    if file.endswith(".onnx"):
        return _OnnxSession(data)
    from models import perceptrons

    network: Network = perceptrons.read(data)
    return network


class _OnnxSession:
    def __init__(self, data: bytes) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session: Any = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])

    def predict(self, images: Vector) -> NDArray[np.int64]:
        (asked,) = self._session.get_inputs()
        (shares,) = self._session.run(None, {asked.name: images.astype(np.float32).reshape(-1, *asked.shape[1:])})
        return np.asarray(shares.argmax(axis=1), np.int64)
