def train(images, labels):
    """Train a classifier on images (one row each, 196 numbers from 0 to 1) and their labels, and return it."""
