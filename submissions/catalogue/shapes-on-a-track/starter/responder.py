import csv
import json

from sklearn.neural_network import MLPClassifier


def shape_of(pixels):
    """Return the shape in an image of collected_shapes.csv, given as a text of 196 digits."""
    # TODO: train a network on the images of the file, and ask it.
    return "square"


def responder(text):
    """Answer IMG_DATA:: with JSON::{"message": {"shape": "square"}}."""
    # TODO: put the shape into the middle of the picture first; the robot is seldom exactly over it.
    return "JSON::" + json.dumps({"message": {"shape": "square"}})
