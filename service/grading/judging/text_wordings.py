"""The wording of sentences on printed, said, sent and received texts: a template of each sentence for each kind.

``texts.py`` decides which sentence is true.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from service.language import translatable
from sim.sentences import Sentence


@dataclass(frozen=True, slots=True)
class TextWording:
    """The wording for a kind of text: a template for each method. ``addressed`` texts have a receiver, unlike prints.

    ``names`` are the values of the templates that are the same in all of them.
    """

    expected: str
    actual: str
    passed: str
    last: str
    misplaced: str
    addressed: bool = False
    names: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def describe_expected(self, texts: str) -> str:
        """Return a clause such as ``Expected the robot to say "a"``."""
        return Sentence(self.expected, texts=texts, **self.names)

    def describe_actual(self, texts: str) -> str:
        """Return a clause such as ``it said "a"``."""
        return Sentence(self.actual, texts=texts, **self.names)

    def describe_passed(self, texts: str) -> str:
        """Return a sentence such as ``The robot said "a".`` in full."""
        return Sentence(self.passed, texts=texts, **self.names)

    def describe_last(self) -> str:
        """Return a noun phrase such as ``last text that the robot said``."""
        return Sentence(self.last, **self.names)

    def describe_misplaced(self, count: int) -> str:
        """Return a clause such as ``such texts were said 3 times at the wrong point``."""
        return Sentence(self.misplaced, count=count, **self.names)


PRINT = TextWording(
    translatable("Expected the program to print %(texts)s"),
    translatable("it printed %(texts)s"),
    translatable("The program printed %(texts)s."),
    translatable("last text that the program printed"),
    translatable("such texts were printed %(count)s times at the wrong point"),
)
RESPONDER_PRINT = TextWording(
    translatable("Expected the responder to print %(texts)s"),
    translatable("it printed %(texts)s"),
    translatable("The responder printed %(texts)s."),
    translatable("last text that the responder printed"),
    translatable("such texts were printed %(count)s times at the wrong point"),
)
SPEECH = TextWording(
    translatable("Expected the robot to say %(texts)s"),
    translatable("it said %(texts)s"),
    translatable("The robot said %(texts)s."),
    translatable("last text that the robot said"),
    translatable("such texts were said %(count)s times at the wrong point"),
)
SENT_TEXT = TextWording(
    translatable("Expected the robot to send %(texts)s"),
    translatable("it sent %(texts)s"),
    translatable("The robot sent %(texts)s."),
    translatable("last text that the robot sent"),
    translatable("such texts were sent %(count)s times at the wrong point"),
    addressed=True,
)
RECEIVED_TEXT = TextWording(
    translatable("Expected the robot to receive %(texts)s"),
    translatable("it received %(texts)s"),
    translatable("The robot received %(texts)s."),
    translatable("last text that the robot received"),
    translatable("such texts were received %(count)s times at the wrong point"),
)
_AGENT_TEXT = TextWording(
    translatable("Expected the %(sender)s to tell the %(receiver)s %(texts)s"),
    translatable("it told the %(receiver)s %(texts)s"),
    translatable("The %(sender)s told the %(receiver)s %(texts)s."),
    translatable("last text that the %(sender)s told the %(receiver)s"),
    translatable("such texts were told the %(receiver)s %(count)s times at the wrong point"),
)


def build_agent_wording(sender: str, receiver: str) -> TextWording:
    """Return the wording for texts from one agent to another."""
    return replace(_AGENT_TEXT, names=MappingProxyType({"sender": sender, "receiver": receiver}))
