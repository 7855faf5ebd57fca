import json


def responder(text):
    """Answer IMG_DATA:: with the bounding box and the number of the black pixels."""
    image = json.loads(text.removeprefix("IMG_DATA::"))
    # TODO: image["left"] is 20 x 20 pixels of red, green, blue and alpha, as numbers with commas.
    return "JSON::" + json.dumps({"message": {"rows": 0, "columns": 0, "black": 0}})
