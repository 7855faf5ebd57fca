"""Classifiers that Robomark brings: how they are trained, what they can do, and their weights.

A file of weights is a pickle, so our own processes load only those whose hash stands on the card beside them; what
students submit is loaded inside their own process.
"""

from models.cards import Card, card, names, weights_bytes

__all__ = ["Card", "card", "names", "weights_bytes"]
