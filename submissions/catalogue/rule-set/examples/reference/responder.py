import json


def decide(left, right):
    if left < 25 and right < 25:
        return "stop"
    if left < 50:
        return "left"
    if right < 50:
        return "right"
    return "forward"


def responder(message):
    try:
        readings = json.loads(message.removeprefix("PY::"))
        what = decide(readings["left"], readings["right"])
    except (ValueError, KeyError, TypeError):
        what = "wait"
    return "JSON::" + json.dumps({"message": {"do": what}})
