import json


def responder(text):
    # What the first robot said is answered to the first robot, and gone.
    if sender == 1:
        return "JSON::" + json.dumps({"news": text.removeprefix("PY::")})
