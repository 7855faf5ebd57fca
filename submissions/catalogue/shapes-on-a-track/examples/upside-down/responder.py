import csv
import json

import numpy as np
from sklearn.neural_network import MLPClassifier


def centred(image):
    """The shape in the middle of 14 x 14 white pixels, wherever it was in the picture; None if there is none."""
    black = image < 127
    if not black.any():
        return None
    rows, columns = np.flatnonzero(black.any(axis=1)), np.flatnonzero(black.any(axis=0))
    box = image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    middle = np.full((14, 14), 255.0)
    top, left = (14 - box.shape[0]) // 2, (14 - box.shape[1]) // 2
    middle[top : top + box.shape[0], left : left + box.shape[1]] = box
    return middle


def trained():
    """A network that has learnt the images of collected_shapes.csv."""
    with open("collected_shapes.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    images = [np.array([int(pixel) for pixel in row["pixels"]]).reshape(14, 14) * 255.0 for row in rows]
    data = np.array([centred(image).ravel() / 255 for image in images])
    network = MLPClassifier(hidden_layer_sizes=(30,), solver="lbfgs", max_iter=25, random_state=1)
    return network.fit(data, [row["shape"] for row in rows])


def picture(csv_text):
    """The grey values of the 14 x 14 pixels in the middle of a 20 x 20 RGBA image."""
    pixels = np.array([int(value) for value in csv_text.split(",")]).reshape(20, 20, 4)
    # Rows are numbered from the top in both; turned over here, up becomes down.
    return pixels[3:17, 3:17, :3].mean(axis=2)[::-1]


network = trained()


def responder(text):
    if not text.startswith("IMG_DATA::"):
        return ""
    image = centred(picture(json.loads(text.removeprefix("IMG_DATA::"))["left"]))
    shape = None if image is None else str(network.predict(image.reshape(1, -1) / 255)[0])
    return "JSON::" + json.dumps({"message": {"shape": shape}})


def shape_of(pixels):
    """The shape in one of the images of collected_shapes.csv, given as a text of 196 digits."""
    image = np.array([int(pixel) for pixel in pixels]).reshape(14, 14) * 255.0
    return str(network.predict(centred(image).reshape(1, -1) / 255)[0])
