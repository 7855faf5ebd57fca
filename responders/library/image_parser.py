"""The JSON responder with a parser that also accepts ``IMG_DATA::`` messages and returns the kind of each message."""

import ast
import json
import re
from pathlib import Path

from nbev3devsim.load_nbev3devwidget import roboSim


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


def simple_echo_agent(msg):
    """Repeat the parsed message."""
    return f"Py saw: {msg}"


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
agent = simple_echo_agent
roboSim.pyresponder = json_responder
