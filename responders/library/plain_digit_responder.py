"""Names the digit under the left light sensor as the course first does: cut to black and white, and without doubt."""

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
    """The kind of message and what is in it, as ``{'typ': ..., 'obj': ...}``; None for any other message."""
    match = re.search(r"^(IMG_DATA|PY)::(.+)", msg)
    if match is None:
        return None
    kind, text = match.groups()
    try:
        return {"typ": kind, "obj": ast.literal_eval(text.strip())}
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return {"typ": kind, "obj": text}


def digit_recognising_agent(msg):
    """What the network says of an image cut to black and white at a grey of 127."""
    image_data = pd.DataFrame(
        [{"side": side, "vals": roboSim.process_raw_image_data(msg["obj"][side])} for side in ("left", "right")]
    )
    left_img, _ = get_sensor_image_pair(image_data, -1, mode="bw")
    digit = int(class_predict_from_image(MLP, left_img))
    return {"report": f"Is that a {digit}?", "digit": digit}


def json_responder(msg_object):
    """Hand the parsed message to the agent and wrap its answer as ``JSON::``."""
    return "JSON::" + json.dumps({"message": agent(parser(msg_object))})


parser = image_parser
agent = digit_recognising_agent
roboSim.pyresponder = json_responder
