"""Creates the folders in ``model_submissions``: responders with model files, good and bad. Run it to recreate them.

``test_student_models.py`` grades them. The models are small, made from the packaged shape network or from scratch.
Only ``convolution/shapes.onnx`` needs the package onnx. Without it, the file stays unchanged.
"""

from __future__ import annotations

import importlib.util
import io
import os
import warnings
import zipfile
from collections.abc import Callable
from typing import Any

import joblib
import numpy as np
import sklearn.base
from sklearn.linear_model import LogisticRegression
from sklearn.neural_network import MLPClassifier, MLPRegressor

from models import load_weights
from models.families.shapes import TASK
from models.perceptrons import load_perceptron
from paths import DATA

FOLDER = DATA / "model_submissions"
#: The file that the hostile pickle would create if it succeeded.
TRACE = "/tmp/robomark-hostile-pickle-was-here"

RESPONDER = """import json

import numpy as np
from joblib import load
from nn_tools import load_onnx, load_weights
from nn_tools.network_views import class_predict_from_image
from PIL import Image

network = {load}
names = ["square", "right facing triangle", "left facing triangle", "downwards facing triangle"]
names += ["upwards facing triangle", "diamond"]


def focus(text):
    pixels = np.array([int(value) for value in json.loads(text[10:])["left"].split(",")]).reshape(20, 20, 4)
    return Image.fromarray(pixels[3:17, 3:17, :3].astype("uint8")).convert("L")


def responder(text):
    image = focus(text)
    shape = names[int({ask})]
    return "JSON::" + json.dumps({{"message": {{"shape": shape}}}})
"""
FROM_JOBLIB = 'load("shapes.joblib")'
KIT = "class_predict_from_image(network, image)"
SCIKIT_LEARN = "network.predict(np.array([image]).reshape(1, -1) / 255)[0]"
MINUTE = "[network.predict(np.random.random((1000, 196))) for _ in range(60_000)][-1][0]"
GIGABYTES = "np.ones((500_000_000,), 'float32').sum()"


class Hostile:
    """Becomes a call of ``os.system`` when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        return os.system, (f"touch {TRACE}",)


def _joblib(value: object) -> bytes:
    file = io.BytesIO()
    joblib.dump(value, file)
    return file.getvalue()


def _npz(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _older(network: MLPClassifier) -> bytes:
    """Return the network as scikit-learn 0.23.2 would have written it; only the version number differs."""
    version = sklearn.base.__version__
    sklearn.base.__version__ = "0.23.2"
    try:
        return _joblib(network)
    finally:
        sklearn.base.__version__ = version


def _plain(network: MLPClassifier, without: int = 0) -> dict[str, Any]:
    """Return the arrays of a file of plain weights, with ``without`` fewer outputs in the first layer."""
    first = network.coefs_[0].shape[1] - without
    return {
        "activation": network.activation,
        "classes": network.classes_,
        "coefs_0": network.coefs_[0][:, :first],
        "intercepts_0": network.intercepts_[0][:first],
        "coefs_1": network.coefs_[1],
        "intercepts_1": network.intercepts_[1],
    }


def _small(kind: type[Any], inputs: int) -> bytes:
    """Return a network of ``kind``, trained on one image of each class."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        network = kind(hidden_layer_sizes=(2,), max_iter=1, random_state=1)
        network.fit(np.random.default_rng(1).random((6, inputs)), np.arange(6))
    return _joblib(network)


def _huge() -> bytes:
    """Return plain weights with a header that claims 2 GB for the first layer, and almost no data."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (250_000_000,)})
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(zipfile.ZipInfo("coefs_0.npy"), header.getvalue())
    return file.getvalue()


def _torch_pickle() -> bytes:
    """Return the beginning of a ``joblib.dump`` of a PyTorch layer."""
    return b"\x80\x04ctorch.nn.modules.linear\nLinear\n)R."


def _convolution() -> bytes:
    """Return a network in ONNX format: random 3 x 3 filters, ReLU, 2 x 2 max pooling, and a fitted last layer."""
    from onnx import TensorProto, helper, numpy_helper

    images, labels = TASK.examples()
    filters = np.random.default_rng(5).normal(size=(8, 1, 3, 3)).astype(np.float32)
    padded = np.pad(images.reshape(-1, 14, 14), ((0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(1, 2))
    maps = np.maximum(np.einsum("nyxij,fij->nfyx", windows, filters[:, 0]), 0)
    pooled = maps.reshape(len(maps), 8, 7, 2, 7, 2).max(axis=(3, 5)).reshape(len(maps), -1)
    last = LogisticRegression(max_iter=2000).fit(pooled, labels)
    tensors = {"filters": filters, "weights": last.coef_.T.astype(np.float32), "offsets": last.intercept_}
    graph = helper.make_graph(
        [
            helper.make_node("Conv", ["image", "filters"], ["maps"], pads=[1, 1, 1, 1]),
            helper.make_node("Relu", ["maps"], ["positive"]),
            helper.make_node("MaxPool", ["positive"], ["pooled"], kernel_shape=[2, 2], strides=[2, 2]),
            helper.make_node("Flatten", ["pooled"], ["flat"]),
            helper.make_node("Gemm", ["flat", "weights", "offsets"], ["scores"]),
        ],
        "shapes",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, ["n", 1, 14, 14])],
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, ["n", 6])],
        [numpy_helper.from_array(value.astype(np.float32), name) for name, value in tensors.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    return bytes(model.SerializeToString())


def grading_requests() -> dict[str, dict[str, bytes]]:
    """Return every folder by name, with its files and their bytes."""
    network = load_perceptron(load_weights("shapes"))

    def brings(data: bytes, ask: str = KIT, load: str = FROM_JOBLIB) -> dict[str, bytes]:
        file = load.split(chr(34))[1]
        return {"responder.py": RESPONDER.format(load=load, ask=ask).encode(), file: data}

    from_npz = 'load_weights("shapes.npz")'
    made = {
        "another-image-size": brings(_small(MLPClassifier, 784)),
        "another-image-size-for-scikit-learn": brings(_small(MLPClassifier, 784), SCIKIT_LEARN),
        "broken-weights": brings(_npz(**_plain(network, without=1)), load=from_npz),
        "hostile-pickle": brings(_joblib(Hostile())),
        "no-model-at-all": brings(b"<!DOCTYPE html>\n<title>Sign in to download shapes.joblib</title>\n"),
        "older-scikit-learn": brings(_older(network)),
        "package-that-is-not-here": brings(_torch_pickle()),
        "plain-weights": brings(_npz(**_plain(network)), load=from_npz),
        "regressor": brings(_small(MLPRegressor, 196)),
        "takes-a-minute": brings(_joblib(network), MINUTE),
        "two-gigabytes": brings(_joblib(network), GIGABYTES),
        "weights-of-two-gigabytes": brings(_huge(), load=from_npz),
    }
    if importlib.util.find_spec("onnx") is not None:
        made["convolution"] = brings(_convolution(), load='load_onnx("shapes.onnx")')
    return made


if __name__ == "__main__":
    for name, files in grading_requests().items():
        (FOLDER / name).mkdir(parents=True, exist_ok=True)
        for file, data in files.items():
            (FOLDER / name / file).write_bytes(data)
