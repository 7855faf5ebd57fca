"""Criteria about how often images are named rightly: at all, and as conditions get harder.

Only what is asked; finding truths and answers is the service's.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from submissions.criteria.common import CriterionBase, Texts, one_or_many
from submissions.sweep import Condition

#: x, y (mm) and what is there.
LabelledPlace = tuple[float, float, str]


class Recognition(CriterionBase):
    """How often the images that the robot sends are named rightly; all trials are pooled.

    ``truth`` is where the right answer comes from: ``"label"`` (what the floor has under the left sensor when
    the image was taken), ``"grey"`` (the label patch in the right sensor's image, decoded as the course
    does), ``"places"`` (the instructor's own: ``places`` is a list of [x, y, label] or a CSV file of such rows
    beside the assignment, and counts where the left sensor's middle is ``within`` so many mm of it), or a
    list, one label for each pose of the scenario.

    The answer is looked for in the reply to the image, at ``answer`` in its JSON if there is such a place,
    else in the reply's text; with ``answer_from`` in what the robot said or printed between this image and
    the next. Case, hyphens and ``aliases`` (label to other names for it) do not matter; an answer that names
    two different labels is wrong. ``confidence`` is where the JSON has a number from 0 to 1; it is shown, and
    never marked. ``late = "wrong"`` counts an answer as wrong that the robot had not got when it sent its
    next image, or at its end.

    ``images`` says which of a trial's images count; those of the same thing from the same place under the
    sensor are one, by the majority of the answers. With ``each_pattern`` all images of one pattern count as one,
    wherever the robot stood: by the ``"first"`` of them, ``"any"`` that is right, or the ``"majority"``; a trial
    that has images of fewer than ``patterns`` patterns gets a wrong answer for each that is missing. With
    ``near_start`` only images count whose sensor was at most so many mm from where it was at the start, so that the
    robot cannot drive or turn to one that is easier. A trial without an image that counts is one wrong answer, so
    that staying silent never helps.
    """

    truth: Literal["label", "grey", "places"] | tuple[str, ...] = "label"
    places: str | tuple[LabelledPlace, ...] = ()
    within: float = Field(default=10.0, gt=0, le=500)
    answer: str | None = Field(default=None, min_length=1)
    answer_from: Literal["reply", "speech", "print"] = "reply"
    confidence: str | None = Field(default=None, min_length=1)
    late: Literal["counts", "wrong"] = "counts"
    labels: tuple[str, ...] = ()  # all that could be named; without it those that the floor and the truths have
    aliases: dict[str, Texts] = Field(default_factory=dict)
    images: Literal["all", "first", "last"] = "all"
    near_start: float | None = Field(default=None, gt=0, le=5000)
    each_pattern: Literal["first", "any", "majority"] | None = None
    patterns: int = Field(default=0, ge=0, le=1000)
    at_least: float | None = Field(default=None, gt=0, le=1)

    @field_validator("truth", mode="plain")
    @classmethod
    def _label_or_list(cls, value: object) -> object:
        if value in ("label", "grey", "places"):
            return value
        if isinstance(value, list | tuple) and value and all(isinstance(label, str) and label for label in value):
            return tuple(value)
        raise ValueError(
            'is neither "label", "grey" or "places" nor a list of labels, '
            "expected one of these words or one label for each pose"
        )

    @field_validator("aliases", mode="before")
    @classmethod
    def _alias_lists(cls, value: object) -> object:
        return {key: one_or_many(names) for key, names in value.items()} if isinstance(value, dict) else value

    @field_validator("over")
    @classmethod
    def _pooled(cls, value: str, info: ValidationInfo) -> str:
        if value not in ("share", "all"):
            raise ValueError('is for criteria judged trial by trial, expected "share" or "all"')
        return value

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.truth == "places") != bool(self.places):
            raise ValueError('needs truth = "places" and places together, expected both or neither')
        if self.patterns and self.each_pattern is None:
            raise ValueError('has patterns without each_pattern, expected each_pattern = "majority" or the like')
        if self.each_pattern is not None and (self.images != "all" or isinstance(self.truth, tuple)):
            raise ValueError(
                "has each_pattern beside images or a list of truths, expected it with what the floor or places tell"
            )
        if self.answer_from != "reply" and (self.confidence is not None or self.late == "wrong"):
            raise ValueError(f'has confidence or late beside answer_from = "{self.answer_from}", expected replies')
        return self


class Classification(Recognition):
    """How often images are named rightly.

    Marks: without ``at_least`` the marks times the accuracy. With it, all marks from that accuracy on, and
    ``marks x accuracy / at_least`` below. ``over = "all"``: all marks from ``at_least`` (1 if not given)
    on, else none. ``steps``, instead, is a list of [accuracy, marks], ascending: the marks of the last step
    that the accuracy reaches, the last of them all the marks there are.
    """

    check: Literal["classification"]
    steps: tuple[tuple[float, float], ...] = ()

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


class Robustness(Recognition):
    """How long images are named rightly as one swept condition gets harder.

    ``along`` is a condition of the scenario's sweep. ``marks_from = "area"``: the marks times the mean height
    of the curve of accuracy (the area under it, by the width of the sweep). ``"falls_below"``: the marks times
    the part of the sweep, from its easiest level outwards, over which the accuracy is at least ``level``. With
    ``at_least``, all marks from that area or part on, and in proportion below it.
    """

    check: Literal["robustness"]
    along: Condition
    marks_from: Literal["area", "falls_below"] = "area"
    level: float | None = Field(default=None, gt=0, le=1)

    @model_validator(mode="after")
    def _level_fits(self) -> Self:
        if (self.level is not None) != (self.marks_from == "falls_below"):
            raise ValueError('needs level with marks_from = "falls_below", and only there, expected both or neither')
        return self
