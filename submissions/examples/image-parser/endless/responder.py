import json


def responder(text):
    parts = []
    # Finds the same :: for ever.
    while "::" in text:
        parts.append(text.split("::")[0])
    return "JSON::" + json.dumps({"message": parts})
