import ast
import json


def parser(text):
    if text.startswith("IMG_DATA::"):
        kind = "IMG_DATA"
        content = text[len("IMG_DATA::"):]
    else:
        kind = "PY"
        content = text[len("PY::"):]
    return {"typ": kind, "obj": ast.literal_eval(content)}


def responder(text):
    parsed = parser(text)
    message = "Py saw: " + str(parsed)
    return "JSON::" + json.dumps({"message": message})
