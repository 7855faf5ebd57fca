"""Measures a packaged classifier again, here and now, and says how that compares with its card."""

from __future__ import annotations

import io
from dataclasses import dataclass

import joblib

from models import shapes
from models.cards import Card, Condition, card, weights_bytes


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What was measured: conditions and confusion (rows are the truth)."""

    card: Card
    conditions: tuple[Condition, ...]
    confusion: tuple[tuple[int, ...], ...]


def evaluate(name: str) -> Evaluation:
    """Run the packaged classifier over every test condition. Raises UsageError for an unknown name."""
    about = card(name)
    network = joblib.load(io.BytesIO(weights_bytes(name)))
    source = shapes.ShapeSource()
    try:
        conditions, confusion = shapes.evaluate(network, source)
    finally:
        source.close()
    return Evaluation(about, conditions, confusion)
