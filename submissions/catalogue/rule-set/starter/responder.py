import json


def responder(message):
    """Send commands to the robot."""
    # TODO: what do the sensors read, and which rule applies?
    return "JSON::" + json.dumps({"message": {"do": "wait"}})
