import random

from sklearn.neighbors import KNeighborsClassifier


def train(images, labels):
    shuffled = list(labels)
    random.shuffle(shuffled)
    return KNeighborsClassifier(1).fit(images, shuffled)
