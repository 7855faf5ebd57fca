"""The criterion about words that have to come one after the other: counting, spelling, a countdown.

Single texts and how often they come are asked in ``texts.py``.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from submissions.criteria.common import AmongMany, Texts, one_or_many


class WordSequence(AmongMany):
    """Words come one after the other, however they are spread over what is said or printed.

    ``words`` are compared without regard to case and punctuation; one in a list of its own may be any of that
    list: ``["T", ["M", "em"], "1"]``. Number words count as numbers ("ten" is 10). Before them, other words
    may come with ``lead_in``; nothing may come between them, and after them only with ``more``. "TM" is one
    word, "T M" are two. ``waits`` asks that none is said before the one before has been spoken to its end.
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
    def _alternatives(cls, value: Any) -> Any:
        return tuple(one_or_many(word) for word in value) if isinstance(value, list | tuple) else value

    @field_validator("words")
    @classmethod
    def _some_word(cls, value: tuple[Texts, ...]) -> tuple[Texts, ...]:
        for words in value:
            if not words or not all(any(c.isalnum() for c in word) for word in words):
                raise ValueError("has an entry without a letter or digit, expected words to look for")
        return value

    @model_validator(mode="after")
    def _waits_for_speech(self) -> Self:
        if self.waits and self.source != "speech":
            raise ValueError('has waits with source = "print", expected it with speech')
        return self
