"""Criteria about coping with a channel that loses, delays and corrupts what is sent.

What is sent and answered at all is asked in ``texts.py`` and ``replies.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from submissions.criteria.common import Criterion, Misfit, Surroundings, Texts
from submissions.criteria.places import Range
from submissions.criteria.texts import TextConditions


class Resends(TextConditions):
    """Each message is sent again until its answer has come, and not after that.

    Messages of the same text are tries of one message; the conditions say which messages are looked at. An answer
    has come when one to any of the tries arrived whole. Between two tries pass from ``every[0]`` to ``every[1]``
    seconds; after ``at_most`` tries the program may give up, and must. ``at_least`` different ones must be sent.
    """

    check: Literal["resends"]
    measures: ClassVar[Texts] = ("different messages", "tries")
    at_least: int = Field(default=1, ge=1)
    at_most: int | None = Field(default=None, ge=1)
    every: Range = (0.1, 10.0)


class InReach(TextConditions):
    """Messages are sent while the robot is in reach of an infrared link: near enough, facing it, in clear sight.

    The conditions say which messages are looked at; ``at_least`` must be sent in reach, ``misses`` are forgiven.
    What is lost by chance was sent in reach.
    """

    check: Literal["in_reach"]
    measures: ClassVar[Texts] = ("sent in reach", "sent out of reach")
    at_least: int = Field(default=1, ge=1)
    misses: int = Field(default=0, ge=0)

    def misfits(self, around: Surroundings) -> Iterator[Misfit]:
        """A cable reaches everywhere."""
        for scenario in around.looked_at_by(self):
            if scenario.channel.link == "cable":
                sentence = f'asks how far the link reaches, expected link = "infrared" in scenario "{scenario.id}"'
                yield Misfit("check", sentence)


class FreshAnswers(Criterion):
    """What the program reports as an answer is the answer to what it sent last, not to something earlier.

    A report is a line, printed or said, that begins with ``after``; what follows must have the answer's words in it,
    or those that its JSON has at ``path``, and no other answer's. Of every text there must be one,
    unless chance kept it from being answered; ``at_least`` different texts must be sent.
    """

    check: Literal["fresh_answers"]
    after: str = Field(min_length=1)
    source: Literal["print", "speech", "either"] = "either"
    path: str | None = Field(default=None, min_length=1)
    at_least: int = Field(default=1, ge=1)

    @property
    def asks_responder(self) -> bool:
        """True: without answers there is nothing to report."""
        return True
