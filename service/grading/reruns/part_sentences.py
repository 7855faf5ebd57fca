"""Sentences on the result of a rerun, and on the parts of a submission that lose marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal
from types import MappingProxyType

from service.grading.reruns.engine import Rerun
from service.grading.reruns.exchanges import AnswersFrom, get_part_file
from service.grading.reruns.halves import decide_losing_parts, find_first_difference, list_part_reruns
from service.language import translatable
from sim.sentences import Sentence, join_sentences, join_with_and

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


def describe_parts(reruns: Sequence[Rerun], criterion: str) -> str:
    """Return which parts lose the marks, and with a losing responder the answer; empty if the reruns don't show it."""
    losing = decide_losing_parts(reruns, criterion)
    if not losing:
        return ""
    single = {parts[0]: rerun for parts, rerun in list_part_reruns(reruns) if len(parts) == 1}
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
            part=get_part_file(part),
            result=result,
        )
    else:
        sentence = Sentence(_SINGLE_PARTS[part], result=result)
    if part != "responder":
        return sentence
    return join_sentences(
        sentence, _describe_first_difference(single[part]), _describe_losing_answer(reruns, criterion)
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
        "With the reference's parts in place of all others, your %(part)s still loses marks.", part=get_part_file(part)
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
    # That all answers of the reference pass is what the sentence before says.
    if passing in (None, 1) or failing != passing + 1:
        return ""
    return Sentence(
        "With the reference's answers from number %(number)s on, the trial passes; from number %(next)s on, it still "
        "fails.",
        number=passing,
        next=failing,
    )


def describe_part_step(reruns: Sequence[Rerun], criterion: str) -> str:
    """Return what the student does next about the parts that lose the marks."""
    losing = decide_losing_parts(reruns, criterion)
    match losing:
        case ("responder",):
            return Sentence("Fix your responder, then submit again.")
        case ("program",):
            return Sentence("Fix your program, then submit again.")
        case ("program", "responder") if all(rerun.passes(criterion) for _, rerun in list_part_reruns(reruns)):
            return Sentence(
                "Compare the texts that your program sends and expects with those that your responder expects and "
                "answers, then submit again."
            )
    if len(losing) == 1:
        return Sentence("Fix %(part)s, then submit again.", part=get_part_file(losing[0]))
    return Sentence("Fix these parts, then submit again: %(parts)s.", parts=_join_parts(losing))


def _join_parts(parts: Sequence[str]) -> str:
    return join_with_and([get_part_file(part) for part in parts])
