"""Recognises the shape below the left light sensor with the network mlp_shapes_14x14.joblib from its own folder."""

import ast
import json
import re
from pathlib import Path

import pandas as pd
from joblib import load

from nbev3devsim.load_nbev3devwidget import roboSim
from nn_tools.network_views import class_predict_from_image
from nn_tools.sensor_data import get_sensor_image_pair

MLP = load("mlp_shapes_14x14.joblib")

shapemap = {
    "square": 0,
    "right facing triangle": 1,
    "left facing triangle": 2,
    "downwards facing triangle": 3,
    "upwards facing triangle": 4,
    "diamond": 5,
}
codemap = {code: shape for shape, code in shapemap.items()}


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


def shape_recognising_agent(msg):
    """Return the network's shape for an image. Repeat a text."""
    if msg is None or msg["typ"] != "IMG_DATA":
        return {"report": f"Agent says: I heard {msg and msg['obj']}"}
    image_data = pd.DataFrame(
        [{"side": side, "vals": roboSim.process_raw_image_data(msg["obj"][side])} for side in ("left", "right")]
    )
    left_img, _ = get_sensor_image_pair(image_data, -1)
    shape = codemap[class_predict_from_image(MLP, left_img)]
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
agent = shape_recognising_agent
roboSim.pyresponder = json_responder
