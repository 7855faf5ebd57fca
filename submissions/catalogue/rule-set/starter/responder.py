import json


def responder(message):
    """Tell the robot what to do."""
    # TODO: what do the sensors read, and which rule applies?
    return "JSON::" + json.dumps({"message": {"do": "wait"}})
