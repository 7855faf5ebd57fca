"""What every criterion has, and how lists of texts are read.

No kind of criterion is here; each has a module of its family.
"""

from __future__ import annotations

from decimal import Decimal
from typing import Literal

from pydantic import Field

from submissions.strict_table import StrictTable

Texts = tuple[str, ...]


def one_or_many(value: object) -> object:
    """A single text stands for a list of one."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, list) else value


def not_blank(value: Texts) -> Texts:
    """Refuses a text that is part of every text."""
    if not all(text.strip() for text in value):
        raise ValueError("has an empty text in it, which every text contains, expected something to look for")
    return value


class CriterionBase(StrictTable):
    """What every criterion has. ``scenarios`` names those it looks at; all, if empty."""

    id: str = Field(default="", pattern=r"^[a-z0-9][a-z0-9_-]*$|^$", max_length=80)  # from the title, if not given
    title: str = Field(min_length=1, max_length=200)
    marks: Decimal = Field(ge=0, le=10000, decimal_places=2)
    scenarios: tuple[str, ...] = ()
    #: how the trials become marks
    over: Literal["share", "all", "mean", "median", "worst"] = "share"
    visibility: Literal["visible", "hidden", "after_due_date", "after_published"] = "visible"
