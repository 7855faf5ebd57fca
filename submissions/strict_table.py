"""The base of every table that an instructor writes: no unknown keys, and no texts where numbers belong.

What a table means is said where it is defined.
"""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict


class StrictTable(BaseModel):
    """Frozen, and refused where it has a key too many or a number that is none.

    What checks it is made when it is first needed: of all kinds of criteria an assignment has a few.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


@dataclass(frozen=True, slots=True)
class Entries:
    """Part of the type of a list of fixed length: what its entries are, in words, for who writes too few or many."""

    words: str
