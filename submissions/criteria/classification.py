"""Criterion about the accuracy of image classification.

Options shared with ``robustness.py`` are in ``recognition.py``.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import model_validator

from submissions.criteria.recognition import Recognition
from submissions.strict_table import Entries, TableMistake


class Classification(Recognition):
    """Accuracy of the answers to the robot's images.

    - Without ``at_least``: the marks times the accuracy.
    - With ``at_least``: full marks from that accuracy, and ``marks x accuracy / at_least`` below it.
    - With ``over = "all"``: full marks from ``at_least`` (default 1), otherwise none.
    - With ``steps``, an ascending list of [accuracy, marks]: the marks of the last step that the accuracy reaches. The
      last step gives full marks.
    """

    check: Literal["classification"]
    steps: tuple[Annotated[tuple[float, float], Entries("[accuracy, marks]")], ...] = ()

    @model_validator(mode="after")
    def _check_steps(self) -> Self:
        if not self.steps:
            return self
        if self.at_least is not None or self.over == "all":
            raise TableMistake("steps", 'has steps beside at_least or over = "all", expected one or the other')
        if any(not (low[0] < high[0] and low[1] <= high[1]) for low, high in pairwise(self.steps)):
            raise TableMistake(
                "steps", "has steps that do not ascend, expected [[accuracy, marks], ...], the easiest first"
            )
        if not (self.steps[0][0] > 0 and self.steps[-1][0] <= 1 and self.steps[0][1] >= 0):
            raise TableMistake("steps", "has a step out of range, expected accuracies above 0 up to 1 and marks from 0")
        if abs(self.steps[-1][1] - float(self.marks)) > 1e-9:
            raise TableMistake(
                "steps", f"has a last step of {self.steps[-1][1]:g} marks, expected {self.marks}: all there are"
            )
        return self
