"""The criterion about training data that a robot collects: how many images of each class, and how good.

What a single log has to hold is asked in ``logged.py``.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from submissions.criteria.common import Criterion, Texts


class Collects(Criterion):
    """The pairs of images that a robot collects are good enough to train with.

    A pair is usable if the left image was taken over a pattern and the right one shows that pattern's label
    label patch, so that its grey decodes to the label as in the course (0, 42, 85 ... for shapes, 25 times the digit).
    ``source`` says which pairs: ``"log"`` those of ``image_data both`` (or ``left`` and ``right`` in turn),
    ``"sent"`` those of ``IMG_DATA``.

    ``each`` is how many different usable pairs there must be of every class in ``classes`` (without it, of
    every label that the floor has). ``balance`` asks that the rarest class has at least that share of the
    pairs of the commonest. ``most_duplicates`` and ``most_unusable`` are the largest shares of pairs that may repeat
    an earlier left image, in its pixels or in the window of the floor, and that may be of no use. The score is the
    part of the images asked for that is there, lowered by what else is missing.
    """

    check: Literal["collects"]
    measures: ClassVar[Texts] = ("pairs", "usable", "duplicates", "different: ...")
    source: Literal["log", "sent"] = "log"
    each: int = Field(default=1, ge=1, le=10_000)
    classes: tuple[str, ...] = ()
    balance: float | None = Field(default=None, gt=0, le=1)
    most_duplicates: float = Field(default=1.0, ge=0, le=1)
    most_unusable: float = Field(default=1.0, ge=0, le=1)
