import json

news = None


def responder(text):
    global news
    if sender == 1:
        news = text.removeprefix("PY::")
        return "noted"
    return "JSON::" + json.dumps({"news": news})
