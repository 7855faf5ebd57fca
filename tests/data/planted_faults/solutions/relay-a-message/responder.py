import json

told = "nothing yet"


def responder(text):
    global told
    if sender == 2:
        return "JSON::" + json.dumps({"told": told})
    told = text[4:]
    return "JSON::" + json.dumps({"ok": True})
