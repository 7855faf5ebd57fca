import json


def responder(text):
    # The prefix is forgotten: the robot only shows such an answer, and its queue stays empty.
    return json.dumps({"message": "Py saw: " + text.replace("PY::", "")})
