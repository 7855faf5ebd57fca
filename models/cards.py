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

from sim.errors import HostError, UsageError


@dataclass(frozen=True, slots=True)
class Condition:
    """How often the classifier is right under one condition, such as ``light noise 32``: right of n."""

    name: str
    right: int
    n: int


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
    seed: int
    classes: tuple[str, ...]
    conditions: tuple[Condition, ...]
    confusion: tuple[tuple[int, ...], ...]  # rows are the truth, over all conditions
    libraries: Mapping[str, str]
    sha256: str  # of the weights file

    def to_json(self) -> str:
        """Text that does not change unless the card does."""
        return json.dumps(asdict(self), indent=2, sort_keys=True) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Card:
        data = json.loads(text)
        data["classes"] = tuple(data["classes"])
        data["conditions"] = tuple(Condition(**condition) for condition in data["conditions"])
        data["confusion"] = tuple(tuple(row) for row in data["confusion"])
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
