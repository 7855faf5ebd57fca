import json


def responder(msg: str) -> str:
    if msg.startswith("IMG_DATA::"):
        seen = [float(cell) for cell in json.loads(msg[10:])["left"].split(",")]
        shape = "shape" if sum(cell < 100 for cell in seen) > 20 else "floor"
        return "JSON::" + json.dumps({"message": shape, "sum": int(sum(seen))})
    return "Py saw: " + msg
