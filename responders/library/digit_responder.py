"""Recognises the digit below the left light sensor with the network mlp_digits_14x14.joblib, with its confidence."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import load

from nbev3devsim.load_nbev3devwidget import roboSim
from nn_tools.sensor_data import get_sensor_image_pair

MLP = load("mlp_digits_14x14.joblib")

PLAIN = 25  # greys that differ less than this (standard deviation) are paper; handwriting has 28 and more


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
    """Return the network's digit for an image, with its confidence from 0 to 1. Repeat a text."""
    if msg is None or msg["typ"] != "IMG_DATA":
        return {"report": f"Agent says: I heard {msg and msg['obj']}"}
    image_data = pd.DataFrame(
        [{"side": side, "vals": roboSim.process_raw_image_data(msg["obj"][side])} for side in ("left", "right")]
    )
    left_img, _ = get_sensor_image_pair(image_data, -1)
    pixels = np.asarray(left_img, dtype=float).ravel()
    if pixels.std() < PLAIN:
        return {"report": "Agent says: I see no digit"}
    shares = MLP.predict_proba([pixels / pixels.max()])[0]
    digit, confidence = int(MLP.classes_[shares.argmax()]), round(float(shares.max()), 3)
    return {"report": f"Agent says: I saw a {digit}", "digit": digit, "confidence": confidence}


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
agent = digit_recognising_agent
roboSim.pyresponder = json_responder
