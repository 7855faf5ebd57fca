import ast
import json


def parse(text):
    kind, _, body = text.partition("::")
    if kind not in ("PY", "IMG_DATA"):
        return None
    try:
        thing = ast.literal_eval(body)
    except (ValueError, SyntaxError):
        thing = body
    return {"typ": kind, "obj": thing}


def responder(text):
    return "JSON::" + json.dumps({"message": f"Py saw: {parse(text)}"})
