"""Base class of all tables that instructors write: unknown keys and texts instead of numbers are errors.

Subclasses define the tables.
"""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict


class StrictTable(BaseModel):
    """Frozen table that rejects unknown keys and invalid numbers.

    Validators are built on first use, because an assignment uses only a few kinds of criteria.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


class TableMistake(ValueError):
    """A mistake in a whole table, raised by a validator. ``key`` is the key whose line shows it."""

    def __init__(self, key: str, sentence: str) -> None:
        super().__init__(sentence)
        self.key = key


@dataclass(frozen=True, slots=True)
class Entries:
    """Annotation of a fixed-length list type: describes its entries in messages about a wrong length."""

    words: str
