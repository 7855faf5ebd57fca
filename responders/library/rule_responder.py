"""Recognises the shape below the left light sensor by rules: its bounding box and the position of its black pixels."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd

from nbev3devsim.load_nbev3devwidget import roboSim
from nn_tools.sensor_data import get_sensor_image_pair

FEWEST_BLACK = 30  # fewer dark pixels than this are no shape; the smallest has 49
DARK = 127  # a grey from here down is black, whatever noise up to 127 does to black and white


def image_parser(msg):
    """Return the kind and the content of a message, as ``{'typ': ..., 'obj': ...}``; None for any other message."""
    match = re.search(r"^(IMG_DATA|PY)::(.+)", msg)
    if match is None:
        return None
    kind, text = match.groups()
    try:
        return {"typ": kind, "obj": ast.literal_eval(text.strip())}
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return {"typ": kind, "obj": text}


def shape_in(image):
    """Return the shape in a greyscale image, or None if there is none."""
    black = np.asarray(image) < DARK
    if black.sum() < FEWEST_BLACK:
        return None
    rows, columns = np.flatnonzero(black.any(axis=1)), np.flatnonzero(black.any(axis=0))
    box = black[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    height, width = box.shape
    if box.mean() > 0.9:
        return "square"
    if width > height:
        return "upwards facing triangle" if weight_below(box) > 0 else "downwards facing triangle"
    # A diamond's halves weigh the same; a triangle's base makes one side much heavier.
    tilt = weight_below(box.T) / box.sum()
    if abs(tilt) < 0.2:
        return "diamond"
    return "left facing triangle" if tilt > 0 else "right facing triangle"


def weight_below(box):
    """Return the black pixels in the lower half minus those in the upper half, without a middle row."""
    half = len(box) // 2
    return int(box[-half:].sum()) - int(box[:half].sum())


def rule_agent(msg):
    """Return the shape in an image according to the rules. Repeat a text."""
    if msg is None or msg["typ"] != "IMG_DATA":
        return {"report": f"Agent says: I heard {msg and msg['obj']}"}
    image_data = pd.DataFrame(
        [{"side": side, "vals": roboSim.process_raw_image_data(msg["obj"][side])} for side in ("left", "right")]
    )
    left_img, _ = get_sensor_image_pair(image_data, -1)
    shape = shape_in(left_img)
    if shape is None:
        return {"report": "Agent says: I see no shape"}
    return {"report": f"Agent says: I saw {shape}", "shape": shape}


def logger(msg, response):
    """Add a message and its answer to logger.txt."""
    with Path("logger.txt").open("a") as file:
        file.write(f"Received message: {msg}\nResponse: {response}\n---\n")


def json_responder(msg_object):
    """Pass the parsed message to the agent and return its answer after ``JSON::``."""
    response = "JSON::" + json.dumps({"message": agent(parser(msg_object))})
    logger(msg_object, response)
    return response


parser = image_parser
agent = rule_agent
roboSim.pyresponder = json_responder
