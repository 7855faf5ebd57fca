import json

import numpy as np
from joblib import load

network = load("mlp_digits_14x14.joblib")


def responder(text):
    image = json.loads(text.removeprefix("IMG_DATA::"))
    pixels = np.array([int(value) for value in image["left"].split(",")]).reshape(20, 20, 4)
    # The lower right corner instead of the middle: three pixels off to begin with.
    grey = pixels[6:, 6:, :3].mean(axis=2).reshape(1, -1)
    digit = network.predict(grey / grey.max())[0]
    return "JSON::" + json.dumps({"message": {"digit": str(digit)}})
