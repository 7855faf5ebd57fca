"""What a packaged classifier is for: the images it is trained on, and the places where it is tested.

The tasks themselves are in ``families/``, a module a family, and each is registered where it is defined.
All are trained and measured by the same code.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from models.images import LabelledPose
from models.preprocessing import Grey, Vector

Examples = tuple[Vector, NDArray[np.int64]]


class Plan(Protocol):
    """How a network is fitted, and what its file is."""

    @property
    def seed(self) -> int:
        """What its chance comes from."""
        ...

    def fit(self, images: Vector, labels: NDArray[np.int64]) -> bytes:
        """The file of a network for ``images`` of shape (n, inputs) and their class numbers; again the same bytes."""
        ...

    def architecture(self, inputs: int, classes: int) -> str:
        """The layers in words."""
        ...


@dataclass(frozen=True, slots=True)
class Altered:
    """A test of images that no packaged floor shows: what is varied over which values, and what is seen at each."""

    varied: str
    unit: str
    under: str
    values: tuple[float, ...]  # ascending
    seen: Callable[[float], Iterable[tuple[int, Grey]]]  # the number of the class, and the focus


@dataclass(frozen=True, slots=True)
class Test:
    """Where a classifier is tested: ``places`` for its accuracy, some of them for its curves.

    ``noises`` are those at which its accuracy is counted, each (grey levels, draws at a place); ``noises_beside`` those
    at which it is tested beside the spot, and ``draws`` the number of draws for a point of a curve that has noise;
    ``altered`` are curves beyond those.
    """

    places: tuple[LabelledPose, ...]
    noises: tuple[tuple[float, int], ...]
    swept: tuple[LabelledPose, ...]
    noises_beside: tuple[float, ...]
    draws: int
    words: str
    altered: tuple[Altered, ...] = ()


@dataclass(frozen=True, slots=True)
class Task:
    """One classifier: its name and files, how it is trained, and how it is tested."""

    name: str
    file: str
    words: str
    classes: tuple[str, ...]
    side: int  # pixels of an image, each way
    plan: Plan
    examples: Callable[[], Examples]
    training_words: str
    test: Callable[[], Test]
    needs: str | None = None  # the package beyond Robomark's own that the training data come in


_TASKS: dict[str, Task] = {}


def register(task: Task) -> Task:
    """Make ``task`` one that can be trained and measured by its name."""
    if task.name in _TASKS:
        raise ValueError(f"there are two models called {task.name}")
    _TASKS[task.name] = task
    return task


def tasks() -> Mapping[str, Task]:
    """Every task by its name, in the order of the names."""
    # A family registers its tasks here, so it cannot be imported before this module is.
    importlib.import_module("models.families")
    return MappingProxyType(dict(sorted(_TASKS.items())))
