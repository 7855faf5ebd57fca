"""Judging of the protocol between robot and responder, from the breaches that its monitor found."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType

from responders.conduct import FLOOD_TEXTS, Breach, BreachKind, find_breaches
from service.grading.grade import Measure, TrialResult
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.language import translatable
from sim.recording_values import get_pose_at
from sim.sentences import Sentence
from submissions.criteria.conduct import Conduct

_RESPONDER_BREACHES: Mapping[BreachKind, str] = MappingProxyType(
    {
        BreachKind.MALFORMED: translatable("the responder answered %(text)s, which is not valid JSON"),
        BreachKind.UNASKED: translatable("the responder answered %(text)s without a message to answer"),
        BreachKind.SPOOFED: translatable("the responder answered %(text)s, which begins like a message of the robot"),
    }
)
_ROBOT_BREACHES: Mapping[BreachKind, str] = MappingProxyType(
    {
        BreachKind.MALFORMED: translatable("the robot sent %(text)s, which is not valid JSON"),
        BreachKind.UNANSWERED: translatable("the responder did not answer %(text)s"),
        BreachKind.SPOOFED: translatable("the robot wrote %(text)s, which looks like an image and is none"),
        BreachKind.FLOOD: translatable("the robot sent more than %(limit)s messages within a second"),
    }
)


@declare_judge(Conduct)
def judge_conduct(criterion: Conduct, trial: TrialResult) -> Outcome:
    """Judge whether robot and responder kept to the protocol."""
    recording = trial.recording
    message_count = sum(message.sender == "robot" for message in recording.messages)
    breaches = [each for each in find_breaches(recording) if each.kind in criterion.forbidden_kinds]
    measures = (Measure(Sentence("messages"), message_count), Measure(Sentence("breaches"), len(breaches)))
    if breaches:
        first_breach = breaches[0]
        message = Sentence(
            "Expected robot and responder to keep to the protocol, but %(breach)s (breaches: %(count)s).",
            breach=_describe_breach(first_breach),
            count=len(breaches),
        )
        score = Fraction(max(message_count - len(breaches), 0), max(message_count, 1))
        return fail_with(message, first_breach.t, get_pose_at(recording, first_breach.t), score, measures)
    if message_count < criterion.at_least:
        return fail_with(
            Sentence(
                "Expected the robot to send %(count)s or more messages, but it sent %(sent)s.",
                count=criterion.at_least,
                sent=message_count,
            ),
            measures=measures,
        )
    return pass_with(
        Sentence("Robot and responder kept to the protocol (messages of the robot: %(count)s).", count=message_count),
        measures=measures,
    )


def _describe_breach(breach: Breach) -> str:
    templates = _RESPONDER_BREACHES if breach.sender == "responder" else _ROBOT_BREACHES
    return Sentence(templates[breach.kind], text=quote_text(breach.text), limit=FLOOD_TEXTS)
