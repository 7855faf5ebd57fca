"""Definitions of the packaged classifiers: training images and test places.

The definitions are in ``families/``, one module per family, and register themselves. All use the same code for training
and evaluation.
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


class NetworkTrainer(Protocol):
    """Training method of a network and format of its file."""

    @property
    def seed(self) -> int:
        """The seed of the random numbers."""
        ...

    def fit(self, images: Vector, labels: NDArray[np.int64]) -> bytes:
        """Train a network reproducibly and return its file; ``images`` has shape (n, inputs)."""
        ...

    def describe_architecture(self, inputs: int, classes: int) -> str:
        """Describe the layers in words."""
        ...


@dataclass(frozen=True, slots=True)
class AlterationTest:
    """Test on images that no packaged floor shows: one varied condition, its values, and the images at each value."""

    varied: str
    unit: str
    under: str
    values: tuple[float, ...]  # ascending
    seen: Callable[[float], Iterable[tuple[int, Grey]]]  # class number and focus of each image


@dataclass(frozen=True, slots=True)
class ClassifierTest:
    """Test of a classifier: ``places`` give the accuracy, and a selection of them the curves.

    ``noises`` are pairs of (grey levels, draws per place) that count for the accuracy. ``noises_beside`` are the noise
    levels tested beside the spot. ``draws`` is the number of draws for a point of a curve with noise. ``altered`` lists
    additional curves.
    """

    places: tuple[LabelledPose, ...]
    noises: tuple[tuple[float, int], ...]
    swept: tuple[LabelledPose, ...]
    noises_beside: tuple[float, ...]
    draws: int
    words: str
    altered: tuple[AlterationTest, ...] = ()


@dataclass(frozen=True, slots=True)
class Task:
    """One classifier: name, files, training and test."""

    name: str
    file: str
    words: str
    classes: tuple[str, ...]
    side: int  # width and height of the images in pixels
    plan: NetworkTrainer
    examples: Callable[[], Examples]
    training_words: str
    test: Callable[[], ClassifierTest]
    needs: str | None = None  # extra package that provides the training data


_TASKS: dict[str, Task] = {}


def register(task: Task) -> Task:
    """Register ``task`` so that it can be trained and evaluated by name."""
    if task.name in _TASKS:
        raise ValueError(f"there are two models called {task.name}")
    _TASKS[task.name] = task
    return task


def load_tasks() -> Mapping[str, Task]:
    """Return all tasks by name, in alphabetical order."""
    # Families import this module to register their tasks, so the import cannot be at the top.
    importlib.import_module("models.families")
    return MappingProxyType(dict(sorted(_TASKS.items())))
