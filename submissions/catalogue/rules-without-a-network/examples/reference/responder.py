import json

import numpy as np


def black_pixels(csv):
    pixels = np.array([int(value) for value in csv.split(",")]).reshape(20, 20, 4)
    return pixels[3:17, 3:17, 0] < 128


def recognise(black):
    """Rules instead of a network: where a shape is widest tells which way it points."""
    rows, columns = np.flatnonzero(black.any(axis=1)), np.flatnonzero(black.any(axis=0))
    shape = black[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    if shape.all():
        return "square"
    across, down = shape.sum(axis=1), shape.sum(axis=0)
    if down[0] > 0.8 * len(rows):
        return "right facing triangle"
    if down[-1] > 0.8 * len(rows):
        return "left facing triangle"
    if across[0] > 0.8 * len(columns):
        return "downwards facing triangle"
    if across[-1] > 0.8 * len(columns):
        return "upwards facing triangle"
    return "diamond"


def responder(text):
    image = json.loads(text.removeprefix("IMG_DATA::"))
    shape = recognise(black_pixels(image["left"]))
    return "JSON::" + json.dumps({"message": {"report": "The rules say " + shape, "shape": shape}})
