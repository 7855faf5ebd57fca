"""Your own networks from files without pickles: plain weights (``.npz``) and ONNX.

Both have ``predict`` and ``predict_proba`` as in scikit-learn. This module trains no networks.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
#: A file name of external data in an ONNX file, as Protocol Buffers encode the key of such an entry.
_EXTERNAL_WEIGHTS = b"\n\x08location\x12"


def _compute_logistic(values: Numbers) -> Numbers:
    return np.asarray(0.5 * (1 + np.tanh(0.5 * values)))


_ACTIVATIONS: Mapping[str, Callable[[Numbers], Numbers]] = MappingProxyType(
    {
        "relu": lambda values: np.maximum(values, 0),
        "tanh": lambda values: np.asarray(np.tanh(values)),
        "logistic": _compute_logistic,
        "identity": lambda values: values,
    }
)


class WeightsNetwork:
    """A multi-layer perceptron from its weights, with softmax as its last step."""

    def __init__(
        self, coefs: list[Numbers], intercepts: list[Numbers], activation: str, classes: NDArray[Any], name: str
    ) -> None:
        self.coefs_, self.intercepts_, self.activation, self.classes_ = coefs, intercepts, activation, classes
        self.n_features_in_ = coefs[0].shape[0]
        self._name = name

    def predict_proba(self, images: Any) -> Numbers:
        """Return class probabilities, shape (images, classes). ``images`` has one row of numbers for each image."""
        values = _to_rows(images, self.n_features_in_, self._name)
        for coefs, intercepts in zip(self.coefs_[:-1], self.intercepts_[:-1], strict=True):
            values = _ACTIVATIONS[self.activation](values @ coefs + intercepts)
        return _compute_softmax(values @ self.coefs_[-1] + self.intercepts_[-1])

    def predict(self, images: Any) -> NDArray[Any]:
        """Return the most likely class of each image, shape (images,)."""
        return np.asarray(self.classes_[self.predict_proba(images).argmax(axis=1)])


class OnnxNetwork:
    """An ONNX network with one input for images and one output with a number for each class."""

    def __init__(self, session: Any, classes: Any, name: str) -> None:
        self._session, self._name = session, name
        inputs, outputs = session.get_inputs(), session.get_outputs()
        if len(inputs) != 1 or not outputs:
            raise ValueError(f"{name} has {len(inputs)} inputs; expected one, the images")
        self._input = inputs[0].name
        self._outputs = [output.name for output in outputs]
        # The first dimension is the number of images; sizes that a model leaves open are not numbers.
        self._shape = tuple(inputs[0].shape[1:])
        if not self._shape or not all(isinstance(size, int) for size in self._shape):
            raise ValueError(f"the input of {name} has the shape {inputs[0].shape}; expected sizes after the first")
        self.n_features_in_ = int(np.prod(self._shape))
        self.classes_ = None if classes is None else np.asarray(classes)

    def predict_proba(self, images: Any) -> Numbers:
        """Return class probabilities, shape (images, classes). Other scores are converted with softmax."""
        rows = _to_rows(images, self.n_features_in_, self._name).astype(np.float32)
        output = self._session.run(self._outputs, {self._input: rows.reshape(-1, *self._shape)})[-1]
        scores = np.asarray(output, np.float64)
        if scores.ndim != 2 or len(scores) != len(rows):
            raise ValueError(f"{self._name} gave numbers of shape {scores.shape}; expected one row of classes an image")
        shares = scores.min() >= 0 and np.allclose(scores.sum(axis=1), 1, atol=1e-3)
        return scores if shares else _compute_softmax(scores)

    def predict(self, images: Any) -> NDArray[Any]:
        """Return the most likely class of each image: its number, or its name if ``classes`` is given."""
        best = self.predict_proba(images).argmax(axis=1)
        return best if self.classes_ is None else np.asarray(self.classes_[best])


def load_weights(file: str | os.PathLike[str]) -> WeightsNetwork:
    """Load a network from a ``.npz`` file: ``coefs_0``, ``intercepts_0``, ``coefs_1`` ..., ``activation``, ``classes``.

    ``coefs_i`` has shape (inputs, outputs) of layer i, ``intercepts_i`` shape (outputs,); ``activation`` is relu, tanh,
    logistic or identity, between layers; ``classes`` has one entry for each output of the last layer.
    Raises ValueError with a sentence for any other file, and never unpickles.
    """
    name = Path(file).name
    arrays = _load_arrays(file, name)
    for wanted in ("coefs_0", "intercepts_0", "activation", "classes"):
        if wanted not in arrays:
            raise ValueError(f"{name} has no array called {wanted}; expected coefs_0, intercepts_0, coefs_1, ..., "
                             "activation and classes")  # fmt: skip
    layers = sum(key.startswith("coefs_") for key in arrays)
    coefs = [_parse_layer(arrays, f"coefs_{number}", name) for number in range(layers)]
    intercepts = [_parse_layer(arrays, f"intercepts_{number}", name) for number in range(layers)]
    _check_layer_shapes(coefs, intercepts, name)
    activation = str(arrays["activation"])
    if activation not in _ACTIVATIONS:
        raise ValueError(f"{name} has the activation {activation[:40]!r}; expected one of {', '.join(_ACTIVATIONS)}")
    classes = arrays["classes"].ravel()
    if len(classes) != coefs[-1].shape[1]:
        raise ValueError(f"{name} has {len(classes)} classes and {coefs[-1].shape[1]} outputs; expected as many")
    return WeightsNetwork(coefs, intercepts, activation, classes, name)


def save_weights(network: Any, file: str | os.PathLike[str]) -> None:
    """Write a trained MLPClassifier as a ``.npz`` file that ``load_weights`` reads."""
    arrays: dict[str, Any] = {"activation": network.activation, "classes": network.classes_}
    for number, (coefs, intercepts) in enumerate(zip(network.coefs_, network.intercepts_, strict=True)):
        arrays |= {f"coefs_{number}": coefs, f"intercepts_{number}": intercepts}
    np.savez_compressed(file, **arrays)


def load_onnx(file: str | os.PathLike[str], classes: Any = None) -> OnnxNetwork:
    """Load the network from an ``.onnx`` file. ``classes`` are the names of its outputs, by default numbers from 0.

    Raises ValueError with a sentence when the file is no such network.
    """
    name = Path(file).name
    import onnxruntime

    data = Path(file).read_bytes()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        if _EXTERNAL_WEIGHTS in data:
            raise ValueError(
                f"{name} has its weights in another file; save the network as one file, "
                "for example with torch.onnx.export(..., external_data=False)"
            ) from None
        raise ValueError(f"{name} cannot be read as a network in ONNX's format: {str(error)[:200]}") from None
    return OnnxNetwork(session, classes, name)


def check_classifier(network: Any, inputs: int) -> None:
    """Raise TypeError if the network predicts no class, and ValueError if its image size differs."""
    kind = type(network).__name__
    if _is_regressor(network):
        raise TypeError(
            f"this model is a regressor ({kind}): it answers with a number, not with a class; "
            "train a classifier, such as MLPClassifier"
        )
    if not callable(getattr(network, "predict", None)):
        raise TypeError(f"this model is a {kind}, which has no predict; expected a trained classifier")
    wanted = getattr(network, "n_features_in_", None)
    if isinstance(wanted, int | np.integer) and wanted != inputs:
        raise ValueError(_describe_size_mismatch(int(wanted), inputs, "this model"))


def _is_regressor(network: Any) -> bool:
    from sklearn.base import is_regressor

    if not hasattr(network, "__sklearn_tags__"):
        return False
    try:
        return bool(is_regressor(network))
    except Exception:
        return False


def _load_arrays(file: str | os.PathLike[str], name: str) -> dict[str, NDArray[Any]]:
    try:
        with Path(file).open("rb") as stream, np.load(stream, allow_pickle=False) as packed:
            return {key: packed[key] for key in packed.files}
    except FileNotFoundError:
        raise
    except (OSError, ValueError, AttributeError, EOFError, KeyError, zipfile.BadZipFile):
        raise ValueError(f"{name} is no file of plain weights; expected arrays written by numpy.savez") from None


def _parse_layer(arrays: dict[str, NDArray[Any]], key: str, name: str) -> Numbers:
    if key not in arrays:
        raise ValueError(f"{name} has no array called {key}; expected layers numbered from 0, each with its intercepts")
    if arrays[key].dtype.kind not in "fiu":
        raise ValueError(f"{key} in {name} does not hold numbers; expected an array of floats")
    return np.asarray(arrays[key], np.float64)


def _check_layer_shapes(coefs: list[Numbers], intercepts: list[Numbers], name: str) -> None:
    for number, (weights, offsets) in enumerate(zip(coefs, intercepts, strict=True)):
        if weights.ndim != 2 or offsets.shape != weights.shape[1:]:
            raise ValueError(
                f"coefs_{number} and intercepts_{number} in {name} have the shapes {weights.shape} and "
                f"{offsets.shape}; expected (inputs, outputs) and (outputs,)"
            )
        if number and weights.shape[0] != coefs[number - 1].shape[1]:
            raise ValueError(
                f"coefs_{number} in {name} takes {weights.shape[0]} numbers, but the layer before gives "
                f"{coefs[number - 1].shape[1]}"
            )


def _to_rows(images: Any, inputs: int, name: str) -> Numbers:
    values = np.asarray(images, np.float64)
    if values.ndim == 0:
        raise ValueError(f"{name} was shown a number; expected a list of images, one row of numbers each")
    rows = values.reshape(1, -1) if values.ndim == 1 else values.reshape(len(values), -1)
    if rows.shape[1] != inputs:
        raise ValueError(_describe_size_mismatch(inputs, rows.shape[1], name))
    return np.asarray(rows)


def _describe_size_mismatch(wanted: int, given: int, name: str) -> str:
    return (
        f"{name} is for images of {_format_size(wanted)}, but was shown one of {_format_size(given)}: resize the "
        "image, or train anew"
    )


def _format_size(numbers: int) -> str:
    side = round(numbers**0.5)
    return f"{side} x {side} pixels ({numbers} numbers)" if side * side == numbers else f"{numbers} numbers"


def _compute_softmax(scores: Numbers) -> Numbers:
    powers = np.exp(scores - scores.max(axis=1, keepdims=True))
    return np.asarray(powers / powers.sum(axis=1, keepdims=True))
