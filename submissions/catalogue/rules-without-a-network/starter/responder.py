import json


def responder(text):
    """Answer a text IMG_DATA::{"left": "...", "right": "..."}."""
    return "JSON::" + json.dumps({"message": {"shape": "square"}})
