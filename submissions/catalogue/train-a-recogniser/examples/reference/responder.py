import numpy as np
from sklearn.neural_network import MLPClassifier


def train(images, labels):
    # A robot never stands exactly where it stood before: each image counts a pixel to every side as well.
    pictures = images.reshape(-1, 14, 14)
    moved = [pictures, *(np.roll(pictures, by, axis) for by in (1, -1) for axis in (1, 2))]
    network = MLPClassifier(hidden_layer_sizes=(40,), max_iter=150, random_state=1)
    network.fit(np.concatenate(moved).reshape(-1, 196), np.tile(labels, 5))
    return network
