from sklearn.neural_network import MLPClassifier


def train(images, labels):
    network = MLPClassifier(hidden_layer_sizes=(5,), max_iter=10)
