"""Explanation of lost marks, shared by all formats: one main cause, the next step, and the source lines.

It explains and does not judge: marks don't depend on it. It uses only what the reader of the view may see.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

from service.grading.grade import Accuracy, CriterionResult, Evidence, Grade, ShownCause
from service.grading.judging.message_parts import WITHHELD_MARKS, find_line, states_fault
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
from sim.sentences import iterate_parts, iterate_values, join_sentences
from submissions.submission import PART_FILES, SECOND_PROGRAM, Submission

#: The names of the times in messages about a trial.
_TIMES = frozenset({"answer", "next", "seconds", "start", "time"})


@dataclass(frozen=True, slots=True)
class Excerpt:
    """Lines of the student's file or cell around the cause."""

    name: str
    lines: tuple[SourceLine, ...]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The main explanation. ``cause`` and ``next_step`` are sentences; ``further`` are secondary causes.

    ``lost`` has the indices of the criteria that lost marks by this cause. ``fault`` is the fault that the cause
    states, or None. ``proof`` is what reruns showed, if there were any, for ``proven``, the index of one of the
    criteria.
    """

    cause: str
    next_step: str
    further: tuple[str, ...] = ()
    excerpt: Excerpt | None = None
    lost: frozenset[int] = frozenset()
    fault: Fault | None = None
    proof: str = ""
    proven: int | None = None


def format_excerpt(diagnosis: Diagnosis) -> list[str]:
    """Return the excerpt as lines of text, with an arrow before the line of the cause."""
    lines = () if diagnosis.excerpt is None else diagnosis.excerpt.lines
    return [f"{'→' if line.marked else ' '} {line.number:>4}  {line.text}".rstrip() for line in lines]


def describe_outcome(grade: Grade, diagnosis: Diagnosis, language: Language = ENGLISH) -> str:
    """Describe how the grade's run ended and who caused it, without repeating the cause."""
    verdict_words = describe_grade(grade, language)
    if verdict_words.happened == diagnosis.cause:
        return verdict_words.explanation
    return f"{verdict_words.happened} {verdict_words.explanation}".strip()


def diagnose(grade: Grade, submission: Submission | None = None, language: Language = ENGLISH) -> Diagnosis:
    """Return the main cause: a hint, else a costly fault, a missing part, or the finding of the costliest criterion.

    Excerpts need the ``submission``. If reruns showed the cause, their proof is added, and its next step replaces a
    general one and one about another line.
    """
    unrefuted_grade = _drop_refuted_hints(grade)
    diagnosis = _diagnose_recorded_trials(unrefuted_grade, submission, language)
    indices = {result.id: index for index, result in enumerate(grade.criteria) if result.marks < result.max_marks}
    causes = [each for each in grade.causes if each.criterion in indices]
    if not causes:
        return diagnosis
    cause = min(causes, key=lambda each: _rank_cause(grade, indices[each.criterion], diagnosis))
    # The step about an error names the error, which is more than a rerun shows.
    has_no_error = grade.verdict in (Verdict.FINISHED, Verdict.TIME_LIMIT)
    is_general = diagnosis.next_step == describe_grade(grade, language).next_step
    is_replaced = has_no_error and (is_general or _names_other_line(cause, unrefuted_grade))
    return replace(
        diagnosis,
        next_step=format_cause_step(cause) if is_replaced else diagnosis.next_step,
        proof=format_proof(cause),
        proven=indices[cause.criterion],
    )


def _names_other_line(cause: ShownCause, grade: Grade) -> bool:
    """Return whether reruns showed a line that is not the one of the first hint.

    A hint about a cell of a notebook is not compared, because reruns count the lines of the extracted file.
    """
    values = dict(iterate_values(cause.next_step))
    place = find_line(next(iter(grade.hints), ""))
    is_comparable = place is None or place[0] in {*PART_FILES.values(), SECOND_PROGRAM}
    return "line" in values and is_comparable and (values["file"], values["line"]) != place


def _drop_refuted_hints(grade: Grade) -> Grade:
    """Return the grade without hints about a part that loses no marks, according to reruns."""
    losing_files = {file for cause in grade.causes for file in cause.files}
    if not losing_files or any(not cause.files for cause in grade.causes):
        return grade
    innocent_files = {*PART_FILES.values(), SECOND_PROGRAM} - losing_files
    hints = (hint for hint in grade.hints if (place := find_line(hint)) is None or place[0] not in innocent_files)
    return replace(grade, hints=tuple(hints))


def _rank_cause(grade: Grade, index: int, diagnosis: Diagnosis) -> tuple[bool, Decimal, int]:
    """Return a key that is smallest for the costliest criterion among those of the diagnosis, or else among all."""
    result = grade.criteria[index]
    return index not in diagnosis.lost, result.marks - result.max_marks, index


def format_proof(cause: ShownCause) -> str:
    """Return what reruns showed, with the note for staff, in one line."""
    return to_display_text(join_sentences(cause.text, cause.staff_note), 800)


def format_cause_step(cause: ShownCause) -> str:
    """Return the next step of a cause that reruns showed."""
    return to_display_text(cause.next_step, 300)


def list_further_proofs(grade: Grade, diagnosis: Diagnosis) -> dict[int, str]:
    """Return what reruns showed for other criteria than that of the diagnosis, by index, without repetitions."""
    indices = {result.id: index for index, result in enumerate(grade.criteria) if result.marks < result.max_marks}
    proofs = {indices[each.criterion]: format_proof(each) for each in grade.causes if each.criterion in indices}
    return {index: proof for index, proof in proofs.items() if index != diagnosis.proven and proof != diagnosis.proof}


def _diagnose_recorded_trials(grade: Grade, submission: Submission | None, language: Language) -> Diagnosis:
    verdict_words = describe_grade(grade, language)
    # Staff adjustments are described in the words of the person who made them.
    automatic_criteria = {index: each for index, each in enumerate(grade.criteria) if each.set_by_hand is None}
    failed_criteria = {index: each for index, each in automatic_criteria.items() if each.marks < each.max_marks}
    if is_not_students_fault(grade.verdict):
        return Diagnosis(verdict_words.happened, verdict_words.next_step)
    hints = format_hints(grade, language)
    if grade.criteria and grade.marks >= grade.max_marks:
        return _diagnose_full_marks(grade, hints, submission, language)
    if hints:
        return _diagnose_hint(grade, hints, failed_criteria, submission, language)
    fault = _find_costly_fault(grade, failed_criteria)
    # A program that waits for an answer from a missing responder runs until the time limit.
    has_waited_in_vain = bool(grade.missing) and fault is not None and fault.verdict is Verdict.TIME_LIMIT
    if fault is not None and not has_waited_in_vain:
        return _diagnose_fault(grade, fault, failed_criteria, submission, language)
    if grade.missing:
        missing_file = ("file", grade.missing)
        affected_criteria = {i for i, each in failed_criteria.items() if missing_file in iterate_values(each.message)}
        return Diagnosis(verdict_words.happened, verdict_words.next_step, lost=frozenset(affected_criteria))
    return (
        _diagnose_criterion(grade, failed_criteria, language)
        if failed_criteria
        else Diagnosis(verdict_words.happened, verdict_words.next_step)
    )


def _diagnose_full_marks(
    grade: Grade, hints: tuple[str, ...], submission: Submission | None, language: Language
) -> Diagnosis:
    """Return the diagnosis for full marks, with what was accepted although it differs from the assignment."""
    full_marks_text = language.say(FULL_MARKS)
    if not hints:
        return Diagnosis(full_marks_text, language.say("No changes needed."))
    cause = language.say(
        "%(full)s Your submission differs from the assignment, but it was accepted: %(difference)s",
        full=full_marks_text,
        difference=hints[0],
    )
    place = find_line(grade.hints[0])
    excerpt = None if place is None else _build_excerpt(submission, *place)
    step = language.say("No changes needed for the marks. Correct this if others use your program.")
    return Diagnosis(cause, step, hints[1:], excerpt)


def _diagnose_hint(
    grade: Grade,
    hints: tuple[str, ...],
    failed_criteria: dict[int, CriterionResult],
    submission: Submission | None,
    language: Language,
) -> Diagnosis:
    hint = grade.hints[0]  # in English; ``hints`` are in the reader's language
    fault = next((each for each in _iterate_faults(grade) if states_fault(hint, each)), None)
    # A hint on one text that is almost right does not affect other criteria.
    criteria = {value for name, value in iterate_values(hint) if name == "criterion"}
    if fault is not None:
        affected_criteria = _find_affected_criteria(grade, fault, failed_criteria)
    else:
        affected_criteria = frozenset(
            index for index, each in failed_criteria.items() if (each.id in criteria if criteria else not each.marks)
        )
    place = find_line(hint)
    if place is None:
        step = language.say("Fix this first, then submit again.")
        return Diagnosis(hints[0], step, hints[1:], lost=affected_criteria, fault=fault)
    name, line = place
    step = language.say(
        "Fix line %(line)s of %(file)s, run it without submitting, then submit again.", line=line, file=name
    )
    excerpt = _build_excerpt(submission, name, line)
    return Diagnosis(hints[0], step, hints[1:], excerpt, lost=affected_criteria, fault=fault)


def _diagnose_fault(
    grade: Grade,
    fault: Fault,
    failed_criteria: dict[int, CriterionResult],
    submission: Submission | None,
    language: Language,
) -> Diagnosis:
    affected_criteria = _find_affected_criteria(grade, fault, failed_criteria)
    if fault.verdict is Verdict.TIME_LIMIT:
        verdict_words = describe_verdict(fault.verdict, language)
        return Diagnosis(verdict_words.happened, verdict_words.next_step, lost=affected_criteria)
    step = describe_grade(grade, language).next_step
    groups = group_faults(grade, submission, language=language)
    group = next(each for each in groups if each.message == to_display_text(fault.message, 600))
    hint = f" {group.hint}" if group.hint else ""
    cause = f"{group.where}: {group.message.rstrip('.')}.{hint}"
    excerpt = Excerpt(group.where, group.excerpt) if group.excerpt else None
    return Diagnosis(cause, step, excerpt=excerpt, lost=affected_criteria, fault=fault)


def _diagnose_criterion(grade: Grade, failed_criteria: dict[int, CriterionResult], language: Language) -> Diagnosis:
    main_index = max(failed_criteria, key=lambda index: failed_criteria[index].max_marks - failed_criteria[index].marks)
    result = failed_criteria[main_index]
    affected_criteria = {index for index, each in failed_criteria.items() if _has_same_failure(grade, result, each)}
    step = describe_grade(grade, language).next_step
    cause = describe_finding(grade, result, language) + _describe_practice_finding(grade, result, language)
    return Diagnosis(cause, step, lost=frozenset({main_index, *affected_criteria}))


def _describe_practice_finding(grade: Grade, result: CriterionResult, language: Language) -> str:
    """Return the findings of an unmarked criterion, if nothing on the marked one may be shown."""
    if _list_failures(result):
        return ""
    practice_criteria = (each for each in grade.criteria if not each.max_marks and _list_failures(each))
    findings = (describe_finding(grade, each, language) for each in practice_criteria)
    return next(
        (" " + language.say("From a criterion for practice (not marked): %(found)s", found=each) for each in findings),
        "",
    )


def describe_withheld_marks(result: CriterionResult, language: Language = ENGLISH) -> str:
    """Return the sentence about the criterion because of which this one gives no marks; empty if there is none."""
    template = language.translate_template(WITHHELD_MARKS)
    sentences = (part for part in iterate_parts(result.message) if part.template == template)
    return next((to_display_text(sentence, 600) for sentence in sentences), "")


def _list_failures(result: CriterionResult) -> list[Evidence]:
    return [each for each in result.evidence if not each.passed]


def describe_finding(grade: Grade, result: CriterionResult, language: Language = ENGLISH) -> str:
    """Return what a criterion found instead of what it expected, in one or two sentences."""
    if result.set_by_hand is not None:
        return to_display_text(result.message, 1000, lines=12)
    accuracy = result.accuracy
    confusions = _list_confusions(result)
    if accuracy is not None and confusions:
        return _describe_confusions(accuracy, confusions, language)
    failure = next((each for each in _list_failures(result) if each.message), None)
    if failure is None:
        return to_display_text(result.message, 600, lines=6)
    finding = to_display_text(failure.message, 600, lines=6)
    if failure.t is None:
        return finding
    if not failure.t or _states_time(failure.message, failure.t):
        return finding + _describe_scenario(grade, failure, language)
    timed_finding = language.say("%(found)s, at %(seconds)s s.", found=finding.rstrip("."), seconds=f"{failure.t:.2f}")
    return timed_finding + _describe_scenario(grade, failure, language)


def _states_time(message: str, t: float) -> bool:
    return any(
        name in _TIMES and value == t and f"%({name})" in part.template
        for part in iterate_parts(message)
        for name, value in part.values.items()
    )


def _describe_confusions(accuracy: Accuracy, confusions: Sequence[tuple[str, str]], language: Language) -> str:
    correct_count, unit = count_correct(accuracy, language)
    confusion_texts = [
        language.say(
            "“%(truth)s” was identified as “%(answer)s”", truth=to_one_line(truth, 60), answer=to_one_line(answer, 60)
        )
        for truth, answer in confusions[:2]
    ]
    examples = language.say(" and ").join(confusion_texts)
    if len(confusions) > len(confusion_texts):
        examples = language.say("%(examples)s, among others", examples=examples)
    return language.say(
        "%(right)s of %(all)s %(of)s were identified correctly: %(examples)s.",
        right=correct_count,
        all=accuracy.n,
        of=unit,
        examples=examples,
    )


def _describe_scenario(grade: Grade, evidence: Evidence, language: Language) -> str:
    if not 0 <= evidence.trial < len(grade.trials) or len(grade.trials) == 1:
        return ""
    trial = grade.trials[evidence.trial]
    has_several_trials = sum(each.scenario == trial.scenario for each in grade.trials) > 1
    scenario_name = format_trial_name(trial, language) if has_several_trials else to_one_line(trial.scenario, 60)
    return " " + language.say("Scenario: %(where)s.", where=scenario_name)


def _find_costly_fault(grade: Grade, failed_criteria: dict[int, CriterionResult]) -> Fault | None:
    """Return the first fault. A time limit counts only if a criterion names it, because alone it costs nothing."""
    failure_messages = [each.message for result in failed_criteria.values() for each in _list_failures(result)]
    return next(
        (
            fault
            for fault in _iterate_faults(grade)
            if fault.verdict is not Verdict.TIME_LIMIT or any(states_fault(each, fault) for each in failure_messages)
        ),
        None,
    )


def _iterate_faults(grade: Grade) -> Iterator[Fault]:
    return (fault for trial in grade.trials for fault in collect_faults(trial.recording))


def _find_affected_criteria(grade: Grade, fault: Fault, failed_criteria: dict[int, CriterionResult]) -> frozenset[int]:
    """Return the criteria that failed only in trials with this fault, and not before it."""
    fault_times = {
        index: min(each.t for each in trial_faults)
        for index, trial in enumerate(grade.trials)
        if (trial_faults := [each for each in collect_faults(trial.recording) if each.message == fault.message])
    }
    return frozenset(
        index
        for index, result in failed_criteria.items()
        if (failures := _list_failures(result))
        and all(
            each.trial in fault_times and _is_after_fault(each, fault_times[each.trial], fault) for each in failures
        )
    )


def _is_after_fault(evidence: Evidence, t: float, fault: Fault) -> bool:
    return evidence.t is None or evidence.t >= t - 0.05 or states_fault(evidence.message, fault)


def _has_same_failure(grade: Grade, result: CriterionResult, other_result: CriterionResult) -> bool:
    """Return whether two criteria lost marks by the same mistake: equal confusions, or the same moment of the run."""
    confusions = _list_confusions(result)
    if confusions or _list_confusions(other_result):
        return set(confusions) == set(_list_confusions(other_result))
    return bool(set(_iterate_failure_times(grade, result)) & set(_iterate_failure_times(grade, other_result)))


def _iterate_failure_times(grade: Grade, result: CriterionResult) -> Iterator[tuple[int, float]]:
    """Yield trial and time of each failure before the end. At the end, unrelated failures coincide."""
    for failure in _list_failures(result):
        if failure.t is None or not 0 <= failure.trial < len(grade.trials):
            continue
        if 0 < failure.t < grade.trials[failure.trial].recording.end_t - 0.05:
            yield failure.trial, round(failure.t, 2)


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
