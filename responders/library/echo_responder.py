"""Answers every ``PY::`` text with its content, and logs both."""

import ast
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


def logger(msg, response):
    """Add a message and its answer to logger.txt."""
    with Path("logger.txt").open("a") as file:
        file.write(f"Received message: {msg}\nResponse: {response}\n---\n")


def echo_responder(msg_object):
    """Echo the parsed message as text."""
    msg = parser(msg_object)
    response = f"Python saw >> {msg} << that..."
    logger(msg, response)
    return response


parser = simple_parser
roboSim.pyresponder = echo_responder
