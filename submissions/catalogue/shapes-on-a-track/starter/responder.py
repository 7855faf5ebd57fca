import csv
import json

from sklearn.neural_network import MLPClassifier


def training_accuracy():
    """How many of the images in collected_shapes.csv the network names rightly, from 0 to 1."""
    # TODO: train a network on these images.
    return 0.0


def responder(text):
    """Answer IMG_DATA:: with JSON::{"message": {"shape": "square"}}."""
    # TODO: put the shape into the middle of the picture first; the robot is seldom exactly over it.
    return "JSON::" + json.dumps({"message": {"shape": "square"}})
