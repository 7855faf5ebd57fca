"""Classifiers packaged with Robomark: training, evaluation and weights.

Weights files are pickles. Robomark's own processes load only files whose hash matches the card beside them. Models
submitted by students are loaded inside the sandbox.
"""

from models.cards import Card, list_classifier_names, load_card, load_weights

__all__ = ["Card", "list_classifier_names", "load_card", "load_weights"]
