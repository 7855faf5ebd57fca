"""Model cards: training data, accuracy and file hash of each packaged classifier.

Each card is a JSON file beside the weights. Reading a card does not load the model.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from models.intervals import compute_wilson_interval
from sim.errors import HostError, UsageError

Confusion = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class Tally:
    """Number of correctly identified images among ``n``."""

    right: int
    n: int

    @property
    def share(self) -> float:
        """Share of correctly identified images, 0 to 1; 0 without images."""
        return self.right / self.n if self.n else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson 95 % confidence interval of the share."""
        return compute_wilson_interval(self.right, self.n)


@dataclass(frozen=True, slots=True)
class CardCurve:
    """Accuracy over the values of one varied condition; ``under`` describes the fixed conditions."""

    varied: str
    unit: str
    under: str
    values: tuple[float, ...]  # ascending
    tallies: tuple[Tally, ...]  # one per value


@dataclass(frozen=True, slots=True)
class AccuracyResults:
    """Results of testing a classifier."""

    accuracy: Tally  # all images of the confusion matrix
    confusion: Confusion  # rows: true class, columns: predicted class
    curves: tuple[CardCurve, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> AccuracyResults:
        """Build an instance from the JSON form of ``asdict``."""
        curves = tuple(
            CardCurve(
                curve["varied"],
                curve["unit"],
                curve["under"],
                tuple(curve["values"]),
                tuple(Tally(**tally) for tally in curve["tallies"]),
            )
            for curve in data["curves"]
        )
        return cls(Tally(**data["accuracy"]), tuple(tuple(row) for row in data["confusion"]), curves)


@dataclass(frozen=True, slots=True)
class Card:
    """Description of a packaged classifier."""

    name: str
    file: str
    task: str
    architecture: str
    preprocessing: str
    training_data: str
    training_images: int
    test_data: str
    seed: int
    classes: tuple[str, ...]
    measured: AccuracyResults
    libraries: Mapping[str, str]
    sha256: str  # SHA-256 of the weights file

    def to_json(self) -> str:
        """Return the card as JSON. Equal cards give equal text."""
        return json.dumps(asdict(self), indent=1, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Card:
        """Parse a card from the text that ``to_json`` returns."""
        data = json.loads(text)
        data["classes"] = tuple(data["classes"])
        data["measured"] = AccuracyResults.from_json(data["measured"])
        return cls(**data)


def _locate_weights_folder() -> Traversable:
    return resources.files("models") / "weights"


def list_classifier_names() -> tuple[str, ...]:
    """Return the names of the packaged classifiers."""
    return tuple(
        sorted(
            entry.name.removesuffix(".json")
            for entry in _locate_weights_folder().iterdir()
            if entry.name.endswith(".json")
        )
    )


def load_card(name: str) -> Card:
    """Return the card of a packaged classifier.

    Raises:
        UsageError: No classifier has this name.
    """
    if name not in list_classifier_names():
        raise UsageError(f"there is no model called {name!r}; expected one of {', '.join(list_classifier_names())}")
    return Card.from_json((_locate_weights_folder() / f"{name}.json").read_text())


def load_weights(name: str) -> bytes:
    """Return the weights file of a packaged classifier.

    Raises:
        HostError: The file does not match the hash on its card.
    """
    card = load_card(name)
    data = (_locate_weights_folder() / card.file).read_bytes()
    if hashlib.sha256(data).hexdigest() != card.sha256:
        raise HostError(f"the weights of {name} ({card.file}) do not match its card; install again")
    return data
