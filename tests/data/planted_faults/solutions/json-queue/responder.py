import json


def agent(content):
    return "Py saw: " + content


def responder(text):
    content = text.split("::")[1]
    reply = {}
    reply["message"] = agent(content)
    return "JSON::" + json.dumps(reply)
