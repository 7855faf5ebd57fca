"""Model cards: what a classifier was trained on, how good it is, and which bytes it is.

A card lies beside its weights as JSON. Reading one loads no model.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

from models.intervals import wilson
from sim.errors import HostError, UsageError

Confusion = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class Tally:
    """How many of ``n`` images were named rightly."""

    right: int
    n: int

    @property
    def share(self) -> float:
        """The part of the images that was named rightly, 0 to 1; 0 without images."""
        return self.right / self.n if self.n else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the share, by Wilson."""
        return wilson(self.right, self.n)


@dataclass(frozen=True, slots=True)
class CardCurve:
    """Tallies while one condition is varied and the rest stays as ``under`` says."""

    varied: str
    unit: str
    under: str
    values: tuple[float, ...]  # ascending
    tallies: tuple[Tally, ...]  # one a value


@dataclass(frozen=True, slots=True)
class Measured:
    """What a test of a classifier found."""

    accuracy: Tally  # of everything in the confusion
    confusion: Confusion  # rows are the truth, columns what was answered
    curves: tuple[CardCurve, ...]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Measured:
        """From what ``asdict`` and JSON have made of one."""
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
    """What there is to know about a classifier."""

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
    measured: Measured
    libraries: Mapping[str, str]
    sha256: str  # of the weights file

    def to_json(self) -> str:
        """Text that does not change unless the card does."""
        return json.dumps(asdict(self), indent=1, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Card:
        """The card that ``to_json`` made this text of."""
        data = json.loads(text)
        data["classes"] = tuple(data["classes"])
        data["measured"] = Measured.from_json(data["measured"])
        return cls(**data)


def _folder() -> Traversable:
    return resources.files("models") / "weights"


def names() -> tuple[str, ...]:
    """The classifiers that are packaged."""
    return tuple(
        sorted(entry.name.removesuffix(".json") for entry in _folder().iterdir() if entry.name.endswith(".json"))
    )


def card(name: str) -> Card:
    """The card of a packaged classifier. Raises UsageError if there is none of that name."""
    if name not in names():
        raise UsageError(f"there is no model called {name!r}; expected one of {', '.join(names())}")
    return Card.from_json((_folder() / f"{name}.json").read_text())


def weights_bytes(name: str) -> bytes:
    """The weights file of a packaged classifier. Raises HostError if it is not the one that its card describes."""
    about = card(name)
    data = (_folder() / about.file).read_bytes()
    if hashlib.sha256(data).hexdigest() != about.sha256:
        raise HostError(f"the weights of {name} ({about.file}) are not those that its card describes; install again")
    return data
