"""The criterion about how often pictures are named rightly.

Only what is asked; finding truths and answers is the service's.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, ValidationInfo, field_validator

from submissions.criteria.common import CriterionBase, Texts, one_or_many


class Classification(CriterionBase):
    """How often the pictures that the robot sends are named rightly; all trials are pooled.

    ``truth`` is ``"label"`` (what the floor has under the left sensor when the picture was taken) or a
    list, one label for each pose of the scenario. The answer is looked for in the reply to the picture, at
    ``answer`` in its JSON if there is such a place, else in the reply's text; with ``answer_from`` in what
    the robot said or printed between this picture and the next. Case, hyphens and ``aliases`` (label to
    other names for it) do not matter; an answer that names two different labels is wrong. ``pictures`` says
    which of a trial's pictures count. A trial without a picture counts as one wrong answer, so that staying
    silent never helps.

    Marks: without ``at_least`` the marks times the accuracy. With it, all marks from that accuracy on, and
    ``marks x accuracy / at_least`` below. ``over = "all"``: all marks from ``at_least`` (1 if not given)
    on, else none.
    """

    check: Literal["classification"]
    truth: Literal["label"] | tuple[str, ...] = "label"
    answer: str | None = Field(default=None, min_length=1)
    answer_from: Literal["reply", "speech", "print"] = "reply"
    labels: tuple[str, ...] = ()  # all that could be named; without it those that the floor and the truths have
    aliases: dict[str, Texts] = Field(default_factory=dict)
    pictures: Literal["all", "first", "last"] = "all"
    at_least: float | None = Field(default=None, gt=0, le=1)

    @field_validator("truth", mode="plain")
    @classmethod
    def _label_or_list(cls, value: object) -> object:
        if value == "label":
            return value
        if isinstance(value, list | tuple) and value and all(isinstance(label, str) and label for label in value):
            return tuple(value)
        raise ValueError('is neither "label" nor a list of labels, expected "label" or one label for each pose')

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
