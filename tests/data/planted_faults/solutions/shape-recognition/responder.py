import json

import joblib
import numpy

model = joblib.load("mlp_shapes_14x14.joblib")
shapes = {
    0: "square",
    1: "right facing triangle",
    2: "left facing triangle",
    3: "downwards facing triangle",
    4: "upwards facing triangle",
    5: "diamond",
}


def responder(message):
    if message.startswith("IMG_DATA::"):
        images = json.loads(message[10:])
        numbers = images["left"].split(",")
        reds = []
        for row in range(3, 17):
            for column in range(3, 17):
                place = (row * 20 + column) * 4
                reds.append(int(numbers[place]))
        features = numpy.array(reds) / 255
        predicted = model.predict([features])
        name = shapes[int(predicted[0])]
        answer = {"message": {"report": "looked", "shape": name}}
    else:
        answer = {"message": None}
    return "JSON::" + json.dumps(answer)
