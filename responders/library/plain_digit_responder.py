"""Recognises the digit below the left light sensor in black and white, as in the course's first version."""

import ast
import json
import re

import pandas as pd
from joblib import load

from nbev3devsim.load_nbev3devwidget import roboSim
from nn_tools.network_views import class_predict_from_image
from nn_tools.sensor_data import get_sensor_image_pair

MLP = load("mlp_digits_14x14.joblib")


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


def digit_recognising_agent(msg):
    """Return the network's digit for an image in black and white, with a threshold of 127."""
    image_data = pd.DataFrame(
        [{"side": side, "vals": roboSim.process_raw_image_data(msg["obj"][side])} for side in ("left", "right")]
    )
    left_img, _ = get_sensor_image_pair(image_data, -1, mode="bw")
    digit = int(class_predict_from_image(MLP, left_img))
    return {"report": f"Is that a {digit}?", "digit": digit}


def json_responder(msg_object):
    """Pass the parsed message to the agent and return its answer after ``JSON::``."""
    return "JSON::" + json.dumps({"message": agent(parser(msg_object))})


parser = image_parser
agent = digit_recognising_agent
roboSim.pyresponder = json_responder
