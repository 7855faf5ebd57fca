"""Base class of criteria about image classification: source of truth, source of answers, and the images that count.

Marks are defined in ``classification.py`` and ``robustness.py``; ``service`` finds truths and answers.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from sim.errors import UsageError
from submissions.assignment.truth_file import LabelledPlace, read_places
from submissions.criteria.common import (
    HOLDS_ANSWERS,
    NOT_EMPTY,
    AssignmentContext,
    Criterion,
    TextOrTexts,
    UnmetRequirement,
)
from submissions.strict_table import TableMistake

#: Grey level of a patch.
Grey = Annotated[int, Field(ge=0, le=255)]
#: Minimum difference between the greys of two patches.
_GREYS_APART = 6


class Recognition(Criterion):
    """Correctness of the answers to the robot's images, pooled over all trials.

    ``truth`` is the source of the right answer:

    - ``"label"``: the label of the floor under the left sensor.
    - ``"grey"``: the label patch in the right sensor's image, decoded as in the course.
    - ``"places"``: ``places``, a list of [x, y, label] or a CSV file with such rows beside the assignment. An entry
      applies within ``within`` mm of the left sensor's centre.
    - a list: one label for each pose of the scenario.

    On an instructor's own image, ``greys`` defines the label patches: ``"shapes"`` or ``"digits"`` as in the course, or
    the grey level of each label.

    The answer is the text or number at ``answer`` in the JSON of the reply; without ``answer``, it is in the text of
    the reply. With ``answer_from``, it is in the robot's speech or printed text before the next image. Case, hyphens
    and ``aliases`` (label to other names) are ignored. An answer that contains two different labels is wrong.
    ``confidence`` is the place of a number from 0 to 1 in the JSON, which is shown but not marked. With ``late =
    "wrong"``, an answer is wrong if it arrives after the next image or after the robot's end.

    ``images`` selects the images of a trial that count. Images of the same object from the same place count as one,
    decided by the majority of the answers. With ``each_pattern``, all images of one pattern count as one, from any
    pose: the ``"first"``, ``"any"`` that is right, or the ``"majority"``. A trial with fewer than ``patterns`` patterns
    gets a wrong answer for each missing pattern.

    With ``near_start``, only images count whose sensor was at most that many mm from its place at the start, so that
    the robot cannot move to an easier pattern. All of a trial's images with the same truth then count as one. With
    ``near_spot``, only images at most that many mm from the middle of their pattern count. A trial without counting
    images has one wrong answer, so that sending nothing is no advantage.
    """

    judges_each_trial: ClassVar[bool] = False
    truth: Annotated[Literal["label", "grey", "places"] | tuple[str, ...], NOT_EMPTY] = "label"
    greys: Literal["shapes", "digits"] | dict[str, Grey] = Field(default_factory=dict)
    places: Annotated[str | tuple[LabelledPlace, ...], HOLDS_ANSWERS] = ()
    within: float = Field(default=10.0, gt=0, le=500)
    answer: str | None = Field(default=None, min_length=1)
    answer_from: Literal["reply", "speech", "print"] = "reply"
    confidence: str | None = Field(default=None, min_length=1)
    late: Literal["counts", "wrong"] = "counts"
    labels: tuple[str, ...] = ()  # all possible labels; defaults to those of the floor and the truths
    aliases: dict[str, TextOrTexts] = Field(default_factory=dict)
    images: Literal["all", "first", "last"] = "all"
    near_start: float | None = Field(default=None, gt=0, le=5000)
    near_spot: float | None = Field(default=None, gt=0, le=500)
    each_pattern: Literal["first", "any", "majority"] | None = None
    patterns: int = Field(default=0, ge=0, le=1000)
    at_least: float | None = Field(default=None, gt=0, le=1)

    @field_validator("truth", mode="plain")
    @classmethod
    def _parse_truth(cls, value: object) -> object:
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
    def _check_over(cls, value: str, info: ValidationInfo) -> str:
        if value not in ("share", "all"):
            raise ValueError('is for criteria judged trial by trial, expected "share" or "all"')
        return value

    @property
    def asks_responder(self) -> bool:
        """True: the classifications are answers of a responder."""
        return True

    def complete_from(self, context: AssignmentContext) -> Self:
        """Return the criterion with the assignment's aliases, and with the rows of its places file in ``places``."""
        update: dict[str, object] = {"aliases": {**context.aliases, **self.aliases}}
        if isinstance(self.places, str):
            try:
                update["places"] = read_places(self.places, context.files)
            except UsageError as error:
                raise UnmetRequirement("places", str(error)) from None
        return self.model_copy(update=update)

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield problems with the truth: no labels on the floor, no label patches, or no truth for a pose."""
        ground = context.ground
        if isinstance(self.truth, tuple):
            for scenario in context.find_scenarios(self):
                if len(self.truth) != len(scenario.poses):
                    yield UnmetRequirement(
                        "truth",
                        f"truth has {len(self.truth)} labels for the {len(scenario.poses)} poses of scenario "
                        f'"{scenario.id}", expected one label for each pose',
                    )
        elif self.greys:
            return
        elif self.truth != "places" and ground is not None and not ground.labels:
            greys = ' greys = "shapes", "digits" or { label = grey level } beside it,' if self.truth == "grey" else ""
            yield UnmetRequirement(
                "truth",
                f'truth is "{self.truth}", but {ground.name} has no labels, '
                f"expected{greys} a list with one label for each pose, or places",
            )
        elif self.truth == "grey" and ground is not None and not ground.label_patches:
            yield UnmetRequirement(
                "truth",
                'truth is "grey", but the world has labels = false, expected truth = "label" or label patches',
            )

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        if (self.truth == "places") != bool(self.places):
            raise TableMistake("truth", 'needs truth = "places" and places together, expected both or neither')
        if self.greys and self.truth != "grey":
            raise TableMistake("greys", 'has greys without truth = "grey", expected both or neither')
        levels = sorted(self.greys.values()) if isinstance(self.greys, dict) else []
        if any(after - before < _GREYS_APART for before, after in pairwise(levels)):
            raise TableMistake("greys", f"has greys that are too similar, expected them {_GREYS_APART} or more apart")
        if self.patterns and self.each_pattern is None:
            raise TableMistake(
                "patterns", 'has patterns without each_pattern, expected each_pattern = "majority" or the like'
            )
        if self.each_pattern is not None and (self.images != "all" or isinstance(self.truth, tuple)):
            raise TableMistake(
                "each_pattern",
                "has each_pattern beside images or a list of truths, expected it with labels from the floor or places",
            )
        if self.answer_from != "reply" and (self.confidence is not None or self.late == "wrong"):
            raise TableMistake(
                "confidence", f'has confidence or late beside answer_from = "{self.answer_from}", expected replies'
            )
        return self
