from sklearn.neural_network import MLPClassifier


def train(images, labels):
    network = MLPClassifier(hidden_layer_sizes=(40,), max_iter=300, random_state=1)
    network.fit(images, labels)
    return network
