"""Criteria about programs that use a channel with loss, delay and corruption.

Criteria about messages and answers in general are in ``texts.py`` and ``replies.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from submissions.criteria.common import AssignmentContext, Criterion, Texts, UnmetRequirement
from submissions.criteria.places import Range
from submissions.criteria.texts import TextConditions


class Resends(TextConditions):
    """Each message is sent again until its answer arrives, and not after that.

    Messages with the same text are tries of one message. The conditions select the messages. A message is answered when
    an intact answer to any of its tries has arrived. The time between two tries is from ``every[0]`` to ``every[1]``
    seconds. After ``at_most`` tries the program may give up, and must not try again. ``at_least`` different messages
    must be sent.
    """

    check: Literal["resends"]
    measures: ClassVar[Texts] = ("different messages", "tries")
    at_least: int = Field(default=1, ge=1)
    at_most: int | None = Field(default=None, ge=1)
    every: Range = (0.1, 10.0)


class InReach(TextConditions):
    """Messages are sent while an infrared link can reach the robot: close enough, facing it, with a clear view.

    The conditions select the messages. ``at_least`` must be sent within reach; up to ``misses`` may be sent out of
    reach. Messages lost by chance count as sent within reach.
    """

    check: Literal["in_reach"]
    measures: ClassVar[Texts] = ("sent in reach", "sent out of reach")
    at_least: int = Field(default=1, ge=1)
    misses: int = Field(default=0, ge=0)

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem for a cable, which reaches everywhere."""
        for scenario in context.find_scenarios(self):
            if scenario.channel.link == "cable":
                sentence = f'asks how far the link reaches, expected link = "infrared" in scenario "{scenario.id}"'
                yield UnmetRequirement("check", sentence)


class FreshAnswers(Criterion):
    """The program reports the answer to its latest message, not an earlier answer.

    A report is a printed or spoken line that begins with ``after``. The rest must contain the words of the answer (or
    those at ``path`` in its JSON), and no other answer's. Each text needs a report, unless chance prevented its answer.
    ``at_least`` different texts must be sent.
    """

    check: Literal["fresh_answers"]
    after: str = Field(min_length=1)
    source: Literal["print", "speech", "either"] = "either"
    path: str | None = Field(default=None, min_length=1)
    at_least: int = Field(default=1, ge=1)

    @property
    def asks_responder(self) -> bool:
        """True: reports need answers."""
        return True
