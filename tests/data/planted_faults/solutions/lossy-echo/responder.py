import json


def responder(text):
    what = text[4:]
    answer = {"number": int(what), "message": "Python saw " + what}
    return "JSON::" + json.dumps(answer)
