import json


def responder(text):
    number = int(text.removeprefix("PY::"))
    return "JSON::" + json.dumps({"message": f"Py saw: {number}"})
