"""The criterion about how often images are named rightly.

What it has in common with ``robustness.py`` is in ``recognition.py``.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import model_validator

from submissions.criteria.recognition import Recognition
from submissions.strict_table import Entries


class Classification(Recognition):
    """How often images are named rightly.

    Marks: without ``at_least`` the marks times the accuracy. With it, all marks from that accuracy on, and
    ``marks x accuracy / at_least`` below. ``over = "all"``: all marks from ``at_least`` (1 if not given)
    on, else none. ``steps``, instead, is a list of [accuracy, marks], ascending: the marks of the last step
    that the accuracy reaches, the last of them all the marks there are.
    """

    check: Literal["classification"]
    steps: tuple[Annotated[tuple[float, float], Entries("[accuracy, marks]")], ...] = ()

    @model_validator(mode="after")
    def _steps_fit(self) -> Self:
        if not self.steps:
            return self
        if self.at_least is not None or self.over == "all":
            raise ValueError('has steps beside at_least or over = "all", expected one or the other')
        if any(not (low[0] < high[0] and low[1] <= high[1]) for low, high in pairwise(self.steps)):
            raise ValueError("has steps that do not ascend, expected [[accuracy, marks], ...], the easiest first")
        if not (self.steps[0][0] > 0 and self.steps[-1][0] <= 1 and self.steps[0][1] >= 0):
            raise ValueError("has a step out of range, expected accuracies above 0 up to 1 and marks from 0")
        if abs(self.steps[-1][1] - float(self.marks)) > 1e-9:
            raise ValueError(f"has a last step of {self.steps[-1][1]:g} marks, expected {self.marks}: all there are")
        return self
