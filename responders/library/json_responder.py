"""Answers every ``PY::`` text with a JSON object that the robot finds in its message queue."""

import ast
import json
import re
from pathlib import Path

from nbev3devsim.load_nbev3devwidget import roboSim


def simple_parser(msg):
    """Return the Python value after ``PY::``, or the text if it is no Python value; None for other messages."""
    match = re.search(r"^PY::(.+)", msg)
    if match is None:
        return None
    text = match.group(1)
    try:
        return ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return text


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


parser = simple_parser
agent = simple_echo_agent
roboSim.pyresponder = json_responder
