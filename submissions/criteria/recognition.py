"""What criteria about naming images have in common: whence the truth, where the answer, which images count.

What that is worth is asked in ``classification.py`` and ``robustness.py``; finding truths and answers is the service's.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from sim.errors import UsageError
from submissions.assignment.truth_file import LabelledPlace, read_places
from submissions.criteria.common import HOLDS_ANSWERS, NOT_EMPTY, Criterion, Misfit, Surroundings, TextOrTexts

#: A grey level of a patch.
Grey = Annotated[int, Field(ge=0, le=255)]
#: Patches whose greys are nearer to one another than this cannot be told apart.
_GREYS_APART = 6


class Recognition(Criterion):
    """How often the images that the robot sends are named rightly; all trials are pooled.

    ``truth`` is where the right answer comes from: ``"label"`` (what the floor has under the left sensor when
    the image was taken), ``"grey"`` (the label patch in the right sensor's image, decoded as the course
    does), ``"places"`` (the instructor's own: ``places`` is a list of [x, y, label] or a CSV file of such rows
    beside the assignment, and counts where the left sensor's middle is ``within`` so many mm of it), or a
    list, one label for each pose of the scenario. On an image of the instructor's own ``greys`` says what the label
    patches stand for: ``"shapes"`` or ``"digits"`` as in the course, or the grey level of each label.

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
    robot cannot drive or turn to one that is easier. With ``near_spot`` only images count whose sensor was at most so
    many mm from the middle of what it shows. A trial without an image that counts is one wrong answer, so
    that staying silent never helps.
    """

    truth: Annotated[Literal["label", "grey", "places"] | tuple[str, ...], NOT_EMPTY] = "label"
    greys: Literal["shapes", "digits"] | dict[str, Grey] = Field(default_factory=dict)
    places: Annotated[str | tuple[LabelledPlace, ...], HOLDS_ANSWERS] = ()
    within: float = Field(default=10.0, gt=0, le=500)
    answer: str | None = Field(default=None, min_length=1)
    answer_from: Literal["reply", "speech", "print"] = "reply"
    confidence: str | None = Field(default=None, min_length=1)
    late: Literal["counts", "wrong"] = "counts"
    labels: tuple[str, ...] = ()  # all that could be named; without it those that the floor and the truths have
    aliases: dict[str, TextOrTexts] = Field(default_factory=dict)
    images: Literal["all", "first", "last"] = "all"
    near_start: float | None = Field(default=None, gt=0, le=5000)
    near_spot: float | None = Field(default=None, gt=0, le=500)
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

    @field_validator("over")
    @classmethod
    def _pooled(cls, value: str, info: ValidationInfo) -> str:
        if value not in ("share", "all"):
            raise ValueError('is for criteria judged trial by trial, expected "share" or "all"')
        return value

    @property
    def asks_responder(self) -> bool:
        """True: what images are taken for is what a responder answers."""
        return True

    def completed(self, around: Surroundings) -> Self:
        """With the assignment's aliases, and with the rows of its file of places in place of the name."""
        update: dict[str, object] = {"aliases": {**around.aliases, **self.aliases}}
        if isinstance(self.places, str):
            try:
                update["places"] = read_places(self.places, around.files)
            except UsageError as error:
                raise Misfit("places", str(error)) from None
        return self.model_copy(update=update)

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """Labels on the floor, label patches to decode, a truth for every pose must be there."""
        ground = around.ground
        if isinstance(self.truth, tuple):
            for scenario in around.looked_at_by(self):
                if len(self.truth) != len(scenario.poses):
                    yield Misfit(
                        "truth",
                        f"truth has {len(self.truth)} labels for the {len(scenario.poses)} poses of scenario "
                        f'"{scenario.id}", expected one label for each pose',
                    )
        elif self.greys:
            return
        elif self.truth != "places" and ground is not None and not ground.labels:
            greys = ' greys = "shapes", "digits" or { label = grey level } beside it,' if self.truth == "grey" else ""
            yield Misfit(
                "truth",
                f'truth is "{self.truth}", but {ground.name} has no labels, '
                f"expected{greys} a list with one label for each pose, or places",
            )
        elif self.truth == "grey" and ground is not None and not ground.label_patches:
            yield Misfit(
                "truth",
                'truth is "grey", but the world has labels = false, expected truth = "label" or label patches',
            )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.truth == "places") != bool(self.places):
            raise ValueError('needs truth = "places" and places together, expected both or neither')
        if self.greys and self.truth != "grey":
            raise ValueError('has greys without truth = "grey", expected both or neither')
        levels = sorted(self.greys.values()) if isinstance(self.greys, dict) else []
        if any(after - before < _GREYS_APART for before, after in pairwise(levels)):
            raise ValueError(f"has greys that are hard to tell apart, expected them {_GREYS_APART} or more apart")
        if self.patterns and self.each_pattern is None:
            raise ValueError('has patterns without each_pattern, expected each_pattern = "majority" or the like')
        if self.each_pattern is not None and (self.images != "all" or isinstance(self.truth, tuple)):
            raise ValueError(
                "has each_pattern beside images or a list of truths, expected it with what the floor or places tell"
            )
        if self.answer_from != "reply" and (self.confidence is not None or self.late == "wrong"):
            raise ValueError(f'has confidence or late beside answer_from = "{self.answer_from}", expected replies')
        return self
