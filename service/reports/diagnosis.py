"""Explanation of lost marks, shared by all formats: one main cause, the next step, and the source lines.

It explains and does not judge: marks don't depend on it. It uses only what the reader of the view may see.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from service.grading.grade import Accuracy, CriterionResult, Evidence, Grade
from service.language import ENGLISH, Language
from service.reports.display_text import to_display_text, to_one_line
from service.reports.faults import SourceLine, extract_excerpt, find_named_source, group_faults
from service.reports.verdict_sentences import (
    FULL_MARKS,
    count_correct,
    describe_grade,
    describe_verdict,
    format_hints,
    format_trial_name,
    is_not_students_fault,
)
from sim.recording import Fault, Verdict
from sim.recording_values import collect_faults
from submissions.submission import Submission

_PLACE = re.compile(r"[Ll]ine (\d+) of (cell \d+|\S+?)(?=[:,]? )")
_QUOTED = re.compile(r'"([^"]{2,})"')
#: A hint on one text that is almost right: found, then expected. It does not affect other criteria.
_NEAR_MISS = re.compile(r'"; expected "')


@dataclass(frozen=True, slots=True)
class Excerpt:
    """Lines of the student's file or cell around the cause."""

    name: str
    lines: tuple[SourceLine, ...]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The main explanation. ``cause`` and ``next_step`` are sentences; ``further`` are secondary causes.

    ``lost`` has the indices of the criteria that lost marks by this cause.
    """

    cause: str
    next_step: str
    further: tuple[str, ...] = ()
    excerpt: Excerpt | None = None
    lost: frozenset[int] = frozenset()


def format_excerpt(diagnosis: Diagnosis) -> list[str]:
    """Return the excerpt as lines of text, with an arrow before the line of the cause."""
    lines = () if diagnosis.excerpt is None else diagnosis.excerpt.lines
    return [f"{'→' if line.marked else ' '} {line.number:>4}  {line.text}".rstrip() for line in lines]


def describe_outcome(grade: Grade, diagnosis: Diagnosis, language: Language = ENGLISH) -> str:
    """Describe how the grade's run ended and who caused it, without repeating the cause."""
    words = describe_grade(grade, language)
    return words.whose if words.happened in diagnosis.cause else f"{words.happened} {words.whose}"


def diagnose(grade: Grade, submission: Submission | None = None, language: Language = ENGLISH) -> Diagnosis:
    """Return the main cause: a hint, else a costly fault, a missing part, or the finding of the costliest criterion.

    Excerpts need the ``submission``.
    """
    words = describe_grade(grade, language)
    # Staff adjustments are described in the words of the person who made them.
    graded = {index: each for index, each in enumerate(grade.criteria) if each.set_by_hand is None}
    lost = {index: each for index, each in graded.items() if each.marks < each.max_marks}
    if is_not_students_fault(grade.verdict):
        return Diagnosis(words.happened, words.next_step)
    hints = format_hints(grade)
    if grade.criteria and grade.marks >= grade.max_marks:
        return _diagnose_full_marks(hints, submission, language)
    if hints:
        return _diagnose_hint(grade, hints, lost, submission, language)
    fault = _find_costly_fault(grade, lost)
    # A program that waits for an answer from a missing responder runs until the time limit.
    waited_in_vain = bool(grade.missing) and fault is not None and fault.verdict is Verdict.TIME_LIMIT
    if fault is not None and not waited_in_vain:
        return _diagnose_fault(grade, fault, lost, submission, language)
    if grade.missing:
        concerned = (index for index, each in lost.items() if grade.missing in each.message)
        return Diagnosis(words.happened, words.next_step, lost=frozenset(concerned))
    return _diagnose_criterion(grade, lost, language) if lost else Diagnosis(words.happened, words.next_step)


def _diagnose_full_marks(hints: tuple[str, ...], submission: Submission | None, language: Language) -> Diagnosis:
    """Return the diagnosis for full marks, with what was accepted although it differs from the assignment."""
    full = language.say(FULL_MARKS)
    if not hints:
        return Diagnosis(full, language.say("No changes needed."))
    cause = language.say(
        "%(full)s Your submission differs from the assignment, but it was accepted: %(difference)s",
        full=full,
        difference=hints[0],
    )
    place = _PLACE.match(hints[0])
    excerpt = _build_excerpt(submission, place[2], int(place[1])) if place is not None else None
    step = language.say("No changes needed for the marks. Correct this if others use your program.")
    return Diagnosis(cause, step, hints[1:], excerpt)


def _diagnose_hint(
    grade: Grade,
    hints: tuple[str, ...],
    lost: dict[int, CriterionResult],
    submission: Submission | None,
    language: Language,
) -> Diagnosis:
    hint = hints[0]
    fault = next(
        (each for each in _iterate_faults(grade) if to_display_text(each.message, 200).rstrip(".") in hint), None
    )
    if fault is not None:
        with_it = _find_affected_criteria(grade, fault, lost)
    elif _NEAR_MISS.search(hint):
        texts = _QUOTED.findall(hint)
        with_it = frozenset(index for index, each in lost.items() if any(text in each.message for text in texts))
    else:
        with_it = frozenset(index for index, each in lost.items() if not each.marks)
    place = _PLACE.match(hint)
    if place is None:
        step = language.say("Fix this first, then submit again.")
        return Diagnosis(hint, step, hints[1:], lost=with_it)
    line, name = int(place[1]), place[2]
    step = language.say(
        "Fix line %(line)s of %(file)s, run it without submitting, then submit again.",
        line=line,
        file=name,
    )
    return Diagnosis(hint, step, hints[1:], _build_excerpt(submission, name, line), lost=with_it)


def _diagnose_fault(
    grade: Grade,
    fault: Fault,
    lost: dict[int, CriterionResult],
    submission: Submission | None,
    language: Language,
) -> Diagnosis:
    step = describe_grade(grade, language).next_step
    if fault.verdict is Verdict.TIME_LIMIT:
        words = describe_verdict(fault.verdict, language)
        return Diagnosis(words.happened, words.next_step, lost=_find_affected_criteria(grade, fault, lost))
    groups = group_faults(grade, submission, language=language)
    group = next(each for each in groups if each.message == to_display_text(fault.message, 600))
    hint = f" {group.hint}" if group.hint else ""
    cause = f"{group.where}: {group.message.rstrip('.')}.{hint}"
    excerpt = Excerpt(group.where, group.excerpt) if group.excerpt else None
    return Diagnosis(cause, step, excerpt=excerpt, lost=_find_affected_criteria(grade, fault, lost))


def _diagnose_criterion(grade: Grade, lost: dict[int, CriterionResult], language: Language) -> Diagnosis:
    main = max(lost, key=lambda index: lost[index].max_marks - lost[index].marks)
    result = lost[main]
    with_it = {index for index, each in lost.items() if _has_same_failure(grade, result, each)}
    step = describe_grade(grade, language).next_step
    cause = describe_finding(grade, result, language) + _describe_practice_finding(grade, result, language)
    return Diagnosis(cause, step, lost=frozenset({main, *with_it}))


def _describe_practice_finding(grade: Grade, result: CriterionResult, language: Language) -> str:
    """Return the findings of an unmarked criterion, if nothing on the marked one may be shown."""
    if _list_failures(result):
        return ""
    seen = (each for each in grade.criteria if not each.max_marks and _list_failures(each))
    told = (describe_finding(grade, each, language) for each in seen)
    return next(
        (" " + language.say("From a criterion for practice (not marked): %(found)s", found=each) for each in told), ""
    )


def _list_failures(result: CriterionResult) -> list[Evidence]:
    return [each for each in result.evidence if not each.passed]


def describe_finding(grade: Grade, result: CriterionResult, language: Language = ENGLISH) -> str:
    """Return what a criterion found instead of what it expected, in one or two sentences."""
    if result.set_by_hand is not None:
        return to_display_text(result.message, 1000, lines=12)
    accuracy = result.accuracy
    wrong = _list_confusions(result)
    if accuracy is not None and wrong:
        return _describe_confusions(accuracy, wrong, language)
    failed = next((each for each in _list_failures(result) if each.message), None)
    if failed is None:
        return to_display_text(result.message, 600, lines=6)
    told = to_display_text(failed.message, 600, lines=6)
    if failed.t is None:
        return told
    if not failed.t or f"{failed.t:.2f} s" in told:
        return told + _describe_scenario(grade, failed, language)
    at = language.say("%(found)s, at %(seconds)s s.", found=told.rstrip("."), seconds=f"{failed.t:.2f}")
    return at + _describe_scenario(grade, failed, language)


def _describe_confusions(accuracy: Accuracy, wrong: Sequence[tuple[str, str]], language: Language) -> str:
    right, of = count_correct(accuracy, language)
    taken = [
        language.say(
            "“%(truth)s” was identified as “%(answer)s”", truth=to_one_line(truth, 60), answer=to_one_line(answer, 60)
        )
        for truth, answer in wrong[:2]
    ]
    examples = language.say(" and ").join(taken)
    if len(wrong) > len(taken):
        examples = language.say("%(examples)s, among others", examples=examples)
    return language.say(
        "%(right)s of %(all)s %(of)s were identified correctly: %(examples)s.",
        right=right,
        all=accuracy.n,
        of=of,
        examples=examples,
    )


def _describe_scenario(grade: Grade, evidence: Evidence, language: Language) -> str:
    if not 0 <= evidence.trial < len(grade.trials) or len(grade.trials) == 1:
        return ""
    trial = grade.trials[evidence.trial]
    several = sum(each.scenario == trial.scenario for each in grade.trials) > 1
    where = format_trial_name(trial, language) if several else to_one_line(trial.scenario, 60)
    return " " + language.say("Scenario: %(where)s.", where=where)


def _find_costly_fault(grade: Grade, lost: dict[int, CriterionResult]) -> Fault | None:
    """Return the first fault. A time limit counts only if a criterion names it, because alone it costs nothing."""
    told = [each.message for result in lost.values() for each in _list_failures(result)]
    return next(
        (
            fault
            for fault in _iterate_faults(grade)
            if fault.verdict is not Verdict.TIME_LIMIT or any(fault.message in message for message in told)
        ),
        None,
    )


def _iterate_faults(grade: Grade) -> Iterator[Fault]:
    return (fault for trial in grade.trials for fault in collect_faults(trial.recording))


def _find_affected_criteria(grade: Grade, fault: Fault, lost: dict[int, CriterionResult]) -> frozenset[int]:
    """Return the criteria that failed only in trials with this fault, and not before it."""
    when = {
        index: min(each.t for each in same)
        for index, trial in enumerate(grade.trials)
        if (same := [each for each in collect_faults(trial.recording) if each.message == fault.message])
    }
    return frozenset(
        index
        for index, result in lost.items()
        if (failed := _list_failures(result))
        and all(each.trial in when and _is_after_fault(each, when[each.trial], fault) for each in failed)
    )


def _is_after_fault(evidence: Evidence, t: float, fault: Fault) -> bool:
    return evidence.t is None or evidence.t >= t - 0.05 or fault.message in evidence.message


def _has_same_failure(grade: Grade, one: CriterionResult, other: CriterionResult) -> bool:
    """Return whether two criteria lost marks by the same mistake: equal confusions, or the same moment of the run."""
    confused = _list_confusions(one)
    if confused or _list_confusions(other):
        return set(confused) == set(_list_confusions(other))
    return bool(set(_iterate_failure_times(grade, one)) & set(_iterate_failure_times(grade, other)))


def _iterate_failure_times(grade: Grade, result: CriterionResult) -> Iterator[tuple[int, float]]:
    """Yield trial and time of each failure before the end. At the end, unrelated failures coincide."""
    for each in _list_failures(result):
        if each.t is None or not 0 <= each.trial < len(grade.trials):
            continue
        if 0 < each.t < grade.trials[each.trial].recording.end_t - 0.05:
            yield each.trial, round(each.t, 2)


def _list_confusions(result: CriterionResult) -> list[tuple[str, str]]:
    """Return pairs of true and assigned label for misidentified images, the most frequent first."""
    if result.accuracy is None:
        return []
    counts: Counter[tuple[str, str]] = Counter()
    for truth, answer, count in result.accuracy.confusion:
        if answer is not None and answer != truth:
            counts[truth, answer] += count
    return [pair for pair, _ in counts.most_common()]


def _build_excerpt(submission: Submission | None, name: str, line: int) -> Excerpt | None:
    source = None if submission is None else find_named_source(name, submission)
    lines = () if source is None else extract_excerpt(source, line)
    return Excerpt(to_one_line(name, 60), lines) if lines else None
