import json


def responder(text):
    start = 0
    # Finds the same :: for ever.
    while text.find("::", start) >= 0:
        kind = text[: text.find("::", start)]
    return "JSON::" + json.dumps({"message": kind})
