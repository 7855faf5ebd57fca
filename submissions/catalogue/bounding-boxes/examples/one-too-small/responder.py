import json


def responder(text):
    image = json.loads(text.removeprefix("IMG_DATA::"))
    red = [int(value) for value in image["left"].split(",")][::4]
    # The numbers of the last and the first row and column are subtracted: one is missing.
    places = [(place // 20, place % 20) for place, value in enumerate(red) if value < 127]
    rows = [row for row, column in places]
    columns = [column for row, column in places]
    box = {"rows": max(rows) - min(rows), "columns": max(columns) - min(columns), "black": len(places)}
    return "JSON::" + json.dumps({"message": box})
