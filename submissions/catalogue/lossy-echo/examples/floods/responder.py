import json


def responder(text):
    number = int(text.removeprefix("PY::"))
    return "JSON::" + json.dumps({"number": number, "message": f"Python saw {number}"})
