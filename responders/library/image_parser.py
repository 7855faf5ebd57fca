"""The JSON responder with a parser that also takes ``IMG_DATA::`` messages and says which kind each was."""

import ast
import json
import re
from pathlib import Path

from nbev3devsim.load_nbev3devwidget import roboSim


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


def simple_echo_agent(msg):
    """Echo whatever the parser made of the message."""
    return f"Py saw: {msg}"


def logger(msg, response):
    """Add a message and its answer to logger.txt."""
    with Path("logger.txt").open("a") as file:
        file.write(f"Received message: {msg}\nResponse: {response}\n---\n")


def json_responder(msg_object):
    """Hand the parsed message to the agent and wrap its answer as ``JSON::``."""
    response = "JSON::" + json.dumps({"message": agent(parser(msg_object))})
    logger(msg_object, response)
    return response


parser = image_parser
agent = simple_echo_agent
roboSim.pyresponder = json_responder
