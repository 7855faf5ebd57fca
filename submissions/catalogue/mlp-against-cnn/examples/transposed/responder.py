import json

import numpy as np
from joblib import load
from nn_tools import load_onnx

mlp = load("mlp_digits_14x14.joblib")
cnn = load_onnx("cnn_digits_14x14.onnx")


def focus(csv):
    """The grey values, 0 to 1, of the 14 x 14 pixels in the middle of a 20 x 20 RGBA image."""
    pixels = np.array([int(value) for value in csv.split(",")]).reshape(20, 20, 4)
    grey = pixels[3:17, 3:17, :3].mean(axis=2)
    return (grey / max(grey.max(), 1)).reshape(1, -1)


def responder(text):
    if not text.startswith("IMG_DATA::"):
        return "JSON::" + json.dumps({"message": None})
    image = focus(json.loads(text.removeprefix("IMG_DATA::"))["left"])
    # Column by column for the second network, as if that were how it is shown images.
    columns = image.reshape(14, 14).T.reshape(1, -1)
    return "JSON::" + json.dumps({"message": {"mlp": str(mlp.predict(image)[0]), "cnn": str(cnn.predict(columns)[0])}})
