"""Criterion about training data that a robot collects: number and quality of images per class.

Criteria about the content of a single log are in ``logs.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from submissions.criteria.common import Criterion, Texts


class Collects(Criterion):
    """The image pairs that a robot collects are suitable for training.

    A pair is usable if the left image shows a pattern and the right image shows the pattern's label patch. The patch's
    grey must decode to the label as in the course (0, 42, 85 ... for shapes, 25 times the digit). ``source`` selects
    the pairs: ``"log"`` for ``image_data both`` (or alternating ``left`` and ``right``), ``"sent"`` for ``IMG_DATA``.

    - ``each``: the number of different usable pairs required for every class in ``classes`` (default: every label of
      the floor).
    - ``balance``: the minimum ratio between the rarest and the most common class.
    - ``most_duplicates``: the maximum share of pairs that repeat an earlier left image, in its pixels or in its window
      of the floor.
    - ``most_unusable``: the maximum share of unusable pairs.

    The score is the share of required images that exist, reduced by violations of the other conditions.
    """

    check: Literal["collects"]
    measures: ClassVar[Texts] = ("pairs", "usable", "duplicates", "different: ...")
    source: Literal["log", "sent"] = "log"
    each: int = Field(default=1, ge=1, le=10_000)
    classes: tuple[str, ...] = ()
    balance: float | None = Field(default=None, gt=0, le=1)
    most_duplicates: float = Field(default=1.0, ge=0, le=1)
    most_unusable: float = Field(default=1.0, ge=0, le=1)
