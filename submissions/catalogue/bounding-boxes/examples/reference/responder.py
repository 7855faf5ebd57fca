import json


def rows_of(csv):
    """The red values of the 14 x 14 pixels in the middle, row by row."""
    red = [int(value) for value in csv.split(",")][::4]
    return [red[20 * row + 3 : 20 * row + 17] for row in range(3, 17)]


def responder(text):
    image = json.loads(text.removeprefix("IMG_DATA::"))
    places = [
        (row, column)
        for row, values in enumerate(rows_of(image["left"]))
        for column, value in enumerate(values)
        if value < 127
    ]
    rows = [row for row, column in places]
    columns = [column for row, column in places]
    box = {
        "rows": max(rows) - min(rows) + 1,
        "columns": max(columns) - min(columns) + 1,
        "black": len(places),
    }
    return "JSON::" + json.dumps({"message": box})
