"""Sentences on causes: the exchange and what the reruns showed with it. They claim nothing else.

A sentence is made from the reruns of a cause. Neither the reference's text nor its answers are part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from service.grading.grade import ShownCause
from service.grading.reruns.causes import Cause, CauseKind
from service.grading.reruns.engine import Rerun
from service.grading.reruns.exchanges import (
    ChangedLine,
    ChangeKind,
    Exchange,
    MoreTime,
    VisibleStart,
    WithoutChannelEffect,
    WithoutLightNoise,
    WithoutMessageLoss,
    WithoutMotorNoise,
    get_part_file,
)
from service.grading.reruns.halves import decide_losing_parts
from service.grading.reruns.mildest_sentences import (
    CONDITIONS_STEP,
    NOISE_STEP,
    RESEND_STEP,
    START_STEP,
    describe_mildest,
    describe_mildest_step,
)
from service.grading.reruns.part_sentences import describe_part_step, describe_parts, describe_result
from service.language import translatable
from sim.sentences import Sentence, join_sentences, join_with_and

_MAX_CHANGE = 60
_EFFECTS: Mapping[str, str] = MappingProxyType(
    {
        "duplication": translatable("no message duplicated"),
        "reordering": translatable("no message out of order"),
        "corruption": translatable("no message changed"),
        "jitter": translatable("the same delay for every message"),
    }
)


_LINE_SENTENCES: Mapping[ChangeKind, str] = MappingProxyType(
    {
        "changed": translatable("With one change in line %(line)s of %(file)s, the same submission %(result)s."),
        "added": translatable(
            "With one more statement after line %(line)s of %(file)s, the same submission %(result)s."
        ),
        "wait": translatable("With a wait after line %(line)s of %(file)s, the same submission %(result)s."),
        "removed": translatable("Without the statement in line %(line)s of %(file)s, the same submission %(result)s."),
    }
)


_FOLLOWING_STEP = translatable("Check what follows line %(line)s of %(file)s, then submit again.")
_LINE_STEP = translatable("Check line %(line)s of %(file)s, then submit again.")
_STAFF_SENTENCES: Mapping[ChangeKind, str] = MappingProxyType(
    {
        "changed": translatable("For staff: in line %(line)s, %(old)s became %(new)s."),
        "added": translatable("For staff: after line %(line)s, this was added: %(new)s."),
        "wait": translatable("For staff: after line %(line)s, this was added: %(new)s."),
        "removed": translatable("For staff: in line %(line)s, this was removed: %(old)s."),
    }
)


def build_shown_causes(causes: Sequence[Cause], reveals: int = 0, revealed_before: int = 0) -> tuple[ShownCause, ...]:
    """Return the causes for reports, one for each criterion.

    A student sees ``reveals`` causes in hidden trials of an assignment; ``revealed_before`` are in other grades.
    """
    shown_causes: list[ShownCause] = []
    revealed_count = revealed_before
    for criterion in dict.fromkeys(each.criterion for each in causes):
        group = [each for each in causes if each.criterion == criterion]
        text = join_sentences(*(describe_cause(each) for each in group))
        if not text:
            continue
        shown_cause = ShownCause(
            criterion,
            text,
            describe_next_step(group[-1] if group[-1].kind == "line" else group[0]),
            files=_list_losing_files(group[0]),
            staff_note=_describe_change(group),
        )
        if any(each.is_hidden for each in group):
            is_revealed = revealed_count < reveals
            revealed_count += is_revealed
            shown_cause = replace(
                shown_cause,
                text=join_sentences(Sentence("In a hidden trial:"), text),
                for_staff=not is_revealed,
                is_hidden=True,
                staff_note=join_sentences(
                    _describe_visibility(is_revealed, revealed_count, reveals), shown_cause.staff_note
                ),
            )
        shown_causes.append(shown_cause)
    return tuple(shown_causes)


def _describe_visibility(is_revealed: bool, revealed_count: int, reveals: int) -> str:
    if is_revealed:
        return Sentence(
            "The student sees this: %(count)s of %(reveals)s causes in hidden trials.",
            count=revealed_count,
            reveals=reveals,
        )
    if not reveals:
        return Sentence("Only staff see this: the assignment shows students no causes in hidden trials.")
    return Sentence(
        "Only staff see this: the student has seen %(count)s of %(reveals)s causes in hidden trials.",
        count=revealed_count,
        reveals=reveals,
    )


def describe_cause(cause: Cause) -> str:
    """Return one or more sentences: what was exchanged, and what the reruns showed; empty for an unknown kind."""
    describe = _DESCRIPTIONS.get(cause.kind)
    return "" if describe is None else describe(cause.reruns, cause.criterion)


def describe_next_step(cause: Cause) -> str:
    """Return what the student does next about a cause."""
    match cause.kind:
        case "parts":
            return describe_part_step(cause.reruns, cause.criterion)
        case "line":
            (change,) = (each for each in cause.reruns[0].exchanges if isinstance(each, ChangedLine))
            step = _FOLLOWING_STEP if change.kind in ("added", "wait") else _LINE_STEP
            return Sentence(step, line=change.line, file=change.file)
        case "time":
            return Sentence("Make your program faster, or its waits shorter, then submit again.")
        case "start":
            return Sentence(START_STEP)
        case "mildest":
            return describe_mildest_step(cause.reruns)
    exchanges = [exchange for rerun in cause.reruns for exchange in rerun.exchanges]
    if any(isinstance(each, WithoutMessageLoss) for each in exchanges):
        return Sentence(RESEND_STEP)
    if any(isinstance(each, WithoutLightNoise | WithoutMotorNoise) for each in exchanges):
        return Sentence(NOISE_STEP)
    return Sentence(CONDITIONS_STEP)


def _list_losing_files(cause: Cause) -> tuple[str, ...]:
    """Return the files of the parts that lose the marks; empty for another kind of cause."""
    if cause.kind != "parts":
        return ()
    return tuple(get_part_file(part) for part in decide_losing_parts(cause.reruns, cause.criterion))


def _describe_conditions(reruns: Sequence[Rerun], criterion: str) -> str:
    first, *others = reruns
    if not first.passes(criterion):
        return ""
    sentence = Sentence(
        "With %(conditions)s, the same submission %(result)s.",
        conditions=join_with_and([_describe_condition(each) for each in first.exchanges]),
        result=describe_result(first, criterion),
    )
    return join_sentences(sentence, *(_describe_messages(each.exchanges) for each in others if each.passes(criterion)))


def _describe_condition(exchange: Exchange) -> str:
    match exchange:
        case WithoutLightNoise():
            return Sentence("the light noise off")
        case WithoutMotorNoise():
            return Sentence("the motor noise off")
        case WithoutMessageLoss():
            return Sentence("no message lost")
        case WithoutChannelEffect(effect=effect):
            return Sentence(_EFFECTS[effect])
    return exchange.key


def _describe_messages(exchanges: Sequence[Exchange]) -> str:
    """Describe the messages of a trial that passes if these are not lost."""
    numbers = sorted(
        number for each in exchanges if isinstance(each, WithoutMessageLoss) for number in each.numbers or ()
    )
    if len(numbers) == 1:
        return Sentence(
            "In one trial it is enough that message %(number)s and its answer are not lost.", number=numbers[0]
        )
    return Sentence(
        "In one trial it is enough that messages %(numbers)s and their answers are not lost.",
        numbers=join_with_and([str(number) for number in numbers]),
    )


def _describe_chance(reruns: Sequence[Rerun], criterion: str) -> str:
    passes = sum(rerun.passes(criterion) for rerun in reruns)
    if not passes:
        return ""
    return Sentence(
        "With %(count)s other random draws of the same noise, one failed trial passes %(passes)s times.",
        count=len(reruns),
        passes=passes,
    )


def _describe_time(reruns: Sequence[Rerun], criterion: str) -> str:
    (rerun,) = reruns
    if not rerun.passes(criterion):
        return ""
    (factor,) = (each.factor for each in rerun.exchanges if isinstance(each, MoreTime))
    return Sentence(
        "With %(factor)s times the simulated time, the same submission %(result)s.",
        factor=f"{factor:g}",
        result=describe_result(rerun, criterion),
    )


def _describe_start(reruns: Sequence[Rerun], criterion: str) -> str:
    (rerun,) = reruns
    if not rerun.passes(criterion):
        return ""
    (pose,) = (each.pose for each in rerun.exchanges if isinstance(each, VisibleStart))
    return Sentence(
        "From the start of a trial that passed, x %(x)s, y %(y)s, heading %(heading)s degrees, a failed trial passes "
        "too.",
        x=f"{pose.x:g}",
        y=f"{pose.y:g}",
        heading=f"{pose.heading:g}",
    )


def _describe_line(reruns: Sequence[Rerun], criterion: str) -> str:
    (rerun,) = reruns
    (change,) = (each for each in rerun.exchanges if isinstance(each, ChangedLine))
    if not rerun.passes(criterion):
        return ""
    sentence = Sentence(
        _LINE_SENTENCES[change.kind],
        line=change.line,
        file=change.file,
        result=describe_result(rerun, criterion),
    )
    return join_sentences(sentence, change.direction)


def _describe_change(causes: Sequence[Cause]) -> str:
    """Return the change of a line, for staff; empty if there is none."""
    exchanges = (each for cause in causes for rerun in cause.reruns for each in rerun.exchanges)
    change = next((each for each in exchanges if isinstance(each, ChangedLine)), None)
    if change is None:
        return ""
    return Sentence(
        _STAFF_SENTENCES[change.kind],
        line=change.line,
        old=_shorten(change.old),
        new=_shorten(change.new),
    )


def _shorten(text: str) -> str:
    return " ".join(text.split())[:_MAX_CHANGE] or '""'


_DESCRIPTIONS: Mapping[CauseKind, Callable[[Sequence[Rerun], str], str]] = MappingProxyType(
    {
        "parts": describe_parts,
        "conditions": _describe_conditions,
        "chance": _describe_chance,
        "time": _describe_time,
        "line": _describe_line,
        "start": _describe_start,
        "mildest": describe_mildest,
    }
)
