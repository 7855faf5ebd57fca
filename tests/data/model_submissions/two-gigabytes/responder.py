import json

import numpy as np
from joblib import load
from nn_tools import load_onnx, load_weights
from nn_tools.network_views import class_predict_from_image
from PIL import Image

network = load("shapes.joblib")
names = ["square", "right facing triangle", "left facing triangle", "downwards facing triangle"]
names += ["upwards facing triangle", "diamond"]


def focus(text):
    pixels = np.array([int(value) for value in json.loads(text[10:])["left"].split(",")]).reshape(20, 20, 4)
    return Image.fromarray(pixels[3:17, 3:17, :3].astype("uint8")).convert("L")


def responder(text):
    image = focus(text)
    shape = names[int(np.ones((500_000_000,), 'float32').sum())]
    return "JSON::" + json.dumps({"message": {"shape": shape}})
