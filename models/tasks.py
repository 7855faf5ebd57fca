"""What a packaged classifier is for: the images it is trained on, and the places where it is tested.

The tasks themselves are in ``shapes.py`` and ``digits.py``; all are trained and measured by the same code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.images import LabelledPose
from models.networks import Plan
from models.preprocessing import Vector

Examples = tuple[Vector, NDArray[np.int64]]


@dataclass(frozen=True, slots=True)
class Test:
    """Where a classifier is tested: ``places`` for its accuracy, some of them for its curves.

    ``noises`` are those at which its accuracy is counted, each (grey levels, draws at a place); ``noises_beside`` those
    at which it is tested beside the spot, and ``draws`` the number of draws for a point of a curve that has noise.
    """

    places: tuple[LabelledPose, ...]
    noises: tuple[tuple[float, int], ...]
    swept: tuple[LabelledPose, ...]
    noises_beside: tuple[float, ...]
    draws: int
    words: str


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
