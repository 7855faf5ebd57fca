from sklearn.neighbors import KNeighborsClassifier


def train(images, labels):
    return KNeighborsClassifier(1).fit(images, labels)
