"""Sentences on causes: the exchange and what the reruns showed with it. They claim nothing else.

A sentence is made from the reruns of a cause. Neither the reference's text nor its answers are part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from types import MappingProxyType

from service.grading.grade import ShownCause
from service.grading.reruns.causes import Cause, CauseKind
from service.grading.reruns.engine import Rerun
from service.grading.reruns.exchanges import (
    SECOND_PROGRAM_PART,
    AnswersFrom,
    ChangedLine,
    Exchange,
    GivenPart,
    MoreTime,
    VisibleStart,
    WithoutChannelEffect,
    WithoutLightNoise,
    WithoutMessageLoss,
    WithoutMotorNoise,
)
from service.grading.reruns.halves import decide_losing_parts, find_first_difference
from service.grading.reruns.mildest_sentences import (
    CONDITIONS_STEP,
    NOISE_STEP,
    RESEND_STEP,
    START_STEP,
    describe_mildest,
    describe_mildest_step,
)
from service.language import translatable
from sim.sentences import Sentence, join_sentences, join_with_and
from submissions.submission import PART_FILES, SECOND_PROGRAM

_FILES: Mapping[str, str] = MappingProxyType(
    {"program": PART_FILES["program"], "responder": PART_FILES["responder"], SECOND_PROGRAM_PART: SECOND_PROGRAM}
)
_MAX_CHANGE = 60
_EFFECTS: Mapping[str, str] = MappingProxyType(
    {
        "duplication": translatable("no message duplicated"),
        "reordering": translatable("no message out of order"),
        "corruption": translatable("no message changed"),
        "jitter": translatable("the same delay for every message"),
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
            return _describe_part_step(cause)
        case "line":
            (change,) = (each for each in cause.reruns[0].exchanges if isinstance(each, ChangedLine))
            return Sentence("Check line %(line)s of %(file)s, then submit again.", line=change.line, file=change.file)
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


def _describe_part_step(cause: Cause) -> str:
    reruns = [rerun for rerun in cause.reruns if all(isinstance(each, GivenPart) for each in rerun.exchanges)]
    losing = decide_losing_parts(reruns, cause.criterion)
    match losing:
        case ("responder",):
            return Sentence("Fix your responder, then submit again.")
        case ("program",):
            return Sentence("Fix your program, then submit again.")
        case ("program", "responder") if all(rerun.passes(cause.criterion) for rerun in reruns):
            return Sentence(
                "Compare the texts that your program sends and expects with those that your responder expects and "
                "answers, then submit again."
            )
    if len(losing) == 1:
        return Sentence("Fix %(part)s, then submit again.", part=_format_part(losing[0]))
    return Sentence("Fix these parts, then submit again: %(parts)s.", parts=_join_parts(losing))


def _list_losing_files(cause: Cause) -> tuple[str, ...]:
    """Return the files of the parts that lose the marks; empty for another kind of cause."""
    if cause.kind != "parts":
        return ()
    reruns = [rerun for rerun in cause.reruns if all(isinstance(each, GivenPart) for each in rerun.exchanges)]
    return tuple(_format_part(part) for part in decide_losing_parts(reruns, cause.criterion))


def describe_result(rerun: Rerun, criterion: str) -> str:
    """Return the result of a rerun that loses nothing, as a verb phrase."""
    outcome = rerun.outcomes[criterion]
    if outcome.is_whole:
        if outcome.max_marks == 1:
            return Sentence("gets the mark")
        return Sentence("gets all %(marks)s marks", marks=_format_marks(outcome.marks))
    count = len((outcome.passed | outcome.failed) & rerun.recordings.keys())
    if count == 1:
        return Sentence("passes in the trial that was run again")
    return Sentence("passes in all %(count)s trials that were run again", count=count)


def _format_marks(marks: Decimal) -> str:
    return f"{marks.normalize():f}"


def _describe_parts(reruns: Sequence[Rerun], criterion: str) -> str:
    part_reruns = [rerun for rerun in reruns if all(isinstance(each, GivenPart) for each in rerun.exchanges)]
    losing = decide_losing_parts(part_reruns, criterion)
    if not losing:
        return ""
    single = {_get_parts(rerun)[0]: rerun for rerun in part_reruns if len(rerun.exchanges) == 1}
    parts = tuple(single)
    if not all(single[part].passes(criterion) for part in losing):
        return _describe_parts_that_still_lose(losing, parts)
    if len(losing) > 1:
        return _describe_misfit(single, losing, criterion)
    (part,) = losing
    result = describe_result(single[part], criterion)
    if len(parts) > 2 or part not in _SINGLE_PARTS:
        sentence: str = Sentence(
            "With the reference's %(part)s in place of yours, the rest of your submission %(result)s: this part "
            "loses the marks.",
            part=_format_part(part),
            result=result,
        )
    else:
        sentence = Sentence(_SINGLE_PARTS[part], result=result)
    if part != "responder":
        return sentence
    return join_sentences(
        sentence, _describe_first_difference(single[part]), _describe_losing_answer(reruns, criterion)
    )


_SINGLE_PARTS: Mapping[str, str] = MappingProxyType(
    {
        "responder": translatable(
            "With the reference's responder in place of yours, the same program %(result)s: the responder loses the "
            "marks."
        ),
        "program": translatable(
            "With the reference's program in place of yours, the same responder %(result)s: the program loses the "
            "marks."
        ),
    }
)


def _describe_parts_that_still_lose(losing: Sequence[str], parts: Sequence[str]) -> str:
    if set(losing) == {"program", "responder"} == set(parts):
        return Sentence(
            "With the reference's responder, your program still loses marks. With the reference's program, your "
            "responder still loses marks."
        )
    if len(losing) > 1:
        return Sentence(
            "With the reference's parts in place of the others, each of these parts still loses marks: %(parts)s.",
            parts=_join_parts(losing),
        )
    (part,) = losing
    if len(parts) == 2 and part == "program":
        return Sentence("With the reference's responder in place of yours, your program still loses marks.")
    if len(parts) == 2 and part == "responder":
        return Sentence("With the reference's program in place of yours, your responder still loses marks.")
    return Sentence(
        "With the reference's parts in place of all others, your %(part)s still loses marks.", part=_format_part(part)
    )


def _describe_misfit(single: Mapping[str, Rerun], losing: Sequence[str], criterion: str) -> str:
    """Describe parts each of which the reference's replaces without loss."""
    if set(losing) == {"program", "responder"} == set(single):
        return Sentence(
            "With the reference's responder, the same program %(first)s. With the reference's program, the same "
            "responder %(second)s. Your program and your responder do not fit together.",
            first=describe_result(single["responder"], criterion),
            second=describe_result(single["program"], criterion),
        )
    return Sentence(
        "With one of these parts of the reference in place of yours, the rest of your submission loses no marks: "
        "%(parts)s.",
        parts=_join_parts(losing),
    )


def _describe_first_difference(rerun: Rerun) -> str:
    numbers = (find_first_difference(rerun.originals[trial], rerun.recordings[trial]) for trial in rerun.trials)
    number = next((each for each in numbers if each is not None), None)
    return "" if number is None else Sentence("The first answer that differs is number %(number)s.", number=number)


def _describe_losing_answer(reruns: Sequence[Rerun], criterion: str) -> str:
    passing: int | None = None
    failing: int | None = None
    for rerun in reruns:
        for exchange in rerun.exchanges:
            if isinstance(exchange, AnswersFrom) and rerun.passes(criterion):
                passing = exchange.number
            elif isinstance(exchange, AnswersFrom) and rerun.loses(criterion):
                failing = exchange.number
    if passing is None or failing != passing + 1:
        return ""
    return Sentence(
        "With the reference's answers from number %(number)s on, the trial passes; from number %(next)s on, it still "
        "fails.",
        number=passing,
        next=failing,
    )


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


def _join_parts(parts: Sequence[str]) -> str:
    return join_with_and([_format_part(part) for part in parts])


def _format_part(part: str) -> str:
    """Return the name of the part's file, under which students know it."""
    return _FILES.get(part, f"{part}.py")


def _get_parts(rerun: Rerun) -> tuple[str, ...]:
    return tuple(each.part for each in rerun.exchanges if isinstance(each, GivenPart))


def _describe_line(reruns: Sequence[Rerun], criterion: str) -> str:
    (rerun,) = reruns
    (change,) = (each for each in rerun.exchanges if isinstance(each, ChangedLine))
    if not rerun.passes(criterion):
        return ""
    sentence = Sentence(
        "With one change in line %(line)s of %(file)s, the same submission %(result)s.",
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
        "For staff: in line %(line)s, %(old)s became %(new)s.",
        line=change.line,
        old=" ".join(change.old.split())[:_MAX_CHANGE] or '""',
        new=" ".join(change.new.split())[:_MAX_CHANGE] or '""',
    )


_DESCRIPTIONS: Mapping[CauseKind, Callable[[Sequence[Rerun], str], str]] = MappingProxyType(
    {
        "parts": _describe_parts,
        "conditions": _describe_conditions,
        "chance": _describe_chance,
        "time": _describe_time,
        "line": _describe_line,
        "start": _describe_start,
        "mildest": describe_mildest,
    }
)
