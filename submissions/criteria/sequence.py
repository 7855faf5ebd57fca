"""Criterion about word sequences: counting, spelling, a countdown.

Criteria about single texts are in ``texts.py``.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.common import CriterionWithStrays, Texts, as_tuple
from submissions.strict_table import TableMistake


class WordSequence(CriterionWithStrays):
    """Words in a given order, in any number of spoken or printed texts.

    Comparison with ``words`` ignores case and punctuation. A nested list gives alternatives: ``["T", ["M", "em"],
    "1"]``. Number words match numbers ("ten" is 10). With ``lead_in``, other words may come before the sequence, and
    with ``more`` after it; none may come between. "TM" is one word, "T M" are two. With ``waits``, each word must start
    after the end of the previous one.
    """

    check: Literal["sequence"]
    measures: ClassVar[Texts] = ("words", "last at")
    source: Literal["print", "speech"] = "speech"
    words: tuple[Texts, ...] = Field(min_length=1)
    lead_in: bool = False
    more: bool = False
    waits: bool = False

    @field_validator("words", mode="before")
    @classmethod
    def _parse_alternatives(cls, value: Any) -> Any:
        return tuple(as_tuple(word) for word in value) if isinstance(value, list | tuple) else value

    @field_validator("words")
    @classmethod
    def _check_words(cls, value: tuple[Texts, ...]) -> tuple[Texts, ...]:
        for alternatives in value:
            if not alternatives or not all(any(c.isalnum() for c in word) for word in alternatives):
                raise ValueError("has an entry without a letter or digit, expected words to look for")
        return value

    @model_validator(mode="after")
    def _check_waits(self) -> Self:
        if self.waits and self.source != "speech":
            raise TableMistake("waits", 'has waits with source = "print", expected it with speech')
        return self
