import json

import numpy as np
from joblib import load

network = load("mlp_digits_14x14.joblib")


def responder(text):
    image = json.loads(text.removeprefix("IMG_DATA::"))
    pixels = np.array([int(value) for value in image["left"].split(",")]).reshape(20, 20, 4)
    # All 400 pixels; the network was trained on the 196 in the middle.
    grey = pixels[:, :, 0].reshape(1, -1) / 255
    return "JSON::" + json.dumps({"message": {"digit": str(network.predict(grey)[0])}})
