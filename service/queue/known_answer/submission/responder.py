import json

import numpy as np


def responder(msg: str) -> str:
    if msg.startswith("IMG_DATA::"):
        seen = np.array([float(cell) for cell in json.loads(msg[10:])["left"].split(",")])
        shape = "shape" if (seen < 100).sum() > 20 else "floor"
        return "JSON::" + json.dumps({"message": shape, "sum": int(seen.sum())})
    return "Py saw: " + msg
