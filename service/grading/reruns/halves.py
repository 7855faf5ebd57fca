"""Halves: which part of a submission loses the marks, shown with the reference's part in place of the student's.

A part loses marks if the submission gets all marks with the reference's part, or if the part loses marks although all
other parts are the reference's. Nothing here shows the reference's text or answers.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from responders import message_format
from service.grading.notebook_trial import NotebookTrial
from service.grading.reruns.engine import BudgetSpent, Rerun, RerunEngine
from service.grading.reruns.exchanges import (
    SECOND_PROGRAM_PART,
    AnswersFrom,
    GivenPart,
    PartName,
    list_texts_and_answers,
)
from service.grading.run_plan import RunPlan, plan_run
from sim.recording import Message, Recording
from submissions.assignment.definition import Assignment
from submissions.seeds import PUBLIC_SECRET, SeedSource
from submissions.submission import Submission


def list_student_parts(assignment: Assignment) -> tuple[PartName, ...]:
    """Return the parts of a trial that students write: programs, responder, and agents by name."""
    parts = assignment.parts
    sources = {
        "program": parts.program,
        "responder": parts.responder,
        SECOND_PROGRAM_PART: parts.second_program,
        **parts.agents,
    }
    return tuple(name for name, source in sources.items() if source == "student")


def plan_reference(reference: Submission, assignment: Assignment, secret: SeedSource = PUBLIC_SECRET) -> RunPlan | None:
    """Return the plan of the reference, whose parts are exchanged; None if it has no separate parts.

    Raises:
        UsageError: The reference has none of the parts that the assignment needs.
    """
    plan = plan_run(reference, assignment, secret)
    return None if isinstance(plan.trial, NotebookTrial) or plan.missing else plan


def find_losing_parts(
    engine: RerunEngine, criterion: str, parts: Sequence[PartName], reference: RunPlan
) -> tuple[Rerun, ...]:
    """Return the reruns that show which parts lose the marks of a criterion; empty if none show it.

    Raises the same errors as ``RerunEngine.rerun``.
    """
    exchanges = {part: GivenPart(part, reference) for part in parts}
    reruns = [engine.rerun_criterion(criterion, (exchange,)) for exchange in exchanges.values()]
    if len(exchanges) > 2 and not decide_losing_parts(reruns, criterion):
        # No single part explains it: each is tried beside the reference's other parts.
        for part in exchanges:
            others = tuple(exchange for name, exchange in exchanges.items() if name != part)
            reruns.append(engine.rerun_criterion(criterion, others))
    return tuple(reruns) if decide_losing_parts(reruns, criterion) else ()


def decide_losing_parts(reruns: Sequence[Rerun], criterion: str) -> tuple[PartName, ...]:
    """Return the parts that lose the marks of a criterion, according to reruns with parts of the reference.

    These are the parts each of which the reference's replaces without loss. If there are none, these are the parts that
    still lose marks beside the reference's other parts. Reruns with other exchanges are left out.
    """
    part_reruns = list_part_reruns(reruns)
    parts = tuple(dict.fromkeys(part for given, _ in part_reruns for part in given))
    losing = tuple(given[0] for given, rerun in part_reruns if len(given) == 1 and rerun.passes(criterion))
    if losing:
        return losing
    own_parts = {
        part
        for given, rerun in part_reruns
        if len(given) == len(parts) - 1 and rerun.loses(criterion)
        for part in parts
        if part not in given
    }
    return tuple(part for part in parts if part in own_parts)


def list_part_reruns(reruns: Sequence[Rerun]) -> list[tuple[tuple[PartName, ...], Rerun]]:
    """Return the reruns in which only parts are the reference's, each with these parts."""
    part_reruns = []
    for rerun in reruns:
        given = tuple(each.part for each in rerun.exchanges if isinstance(each, GivenPart))
        if given and len(given) == len(rerun.exchanges):
            part_reruns.append((given, rerun))
    return part_reruns


def find_first_difference(own: Recording, other: Recording) -> int | None:
    """Return the number, from 1, of the first text whose answers differ; None if none differ before the robots do."""
    pairs = zip(list_texts_and_answers(own), list_texts_and_answers(other), strict=False)
    for number, ((own_text, own_answers), (other_text, other_answers)) in enumerate(pairs, start=1):
        if (own_text.t, own_text.text) != (other_text.t, other_text.text):
            return None
        if _read_answers(own_text, own_answers) != _read_answers(other_text, other_answers):
            return number
    return None


def _read_answers(text: Message, answers: Sequence[Message]) -> list[tuple[float, str]]:
    """Return the time and the content of the answers; that of JSON does not depend on spaces or the order of keys."""
    return [(each.t - text.t, _read_content(each.text)) for each in answers]


def _read_content(text: str) -> str:
    if text.startswith(message_format.JSON):
        try:
            return message_format.JSON + json.dumps(message_format.parse_answer(text), sort_keys=True)
        except (ValueError, RecursionError):
            return text
    return text


def find_losing_answer(
    engine: RerunEngine, criterion: str, rerun: Rerun, reference: RunPlan
) -> tuple[Rerun, Rerun] | None:
    """Return reruns of a trial with the reference's answers from one number on, which passes, and from the next on.

    So the answer of this number loses the marks. ``rerun`` is with the reference's responder. None if it is not shown.
    """
    failed_trials = set(engine.list_failed_trials(criterion)) & rerun.outcomes[criterion].passed
    trial = next((each for each in rerun.trials if each in failed_trials and _differs(rerun, each)), None)
    if trial is None:
        return None
    own = rerun.originals[trial]

    def rerun_from(number: int) -> Rerun:
        return engine.rerun((trial,), (AnswersFrom(number, reference, own),))

    # Passes from ``low`` on, because the answers before it are the same; fails from ``high`` on.
    low, high = find_first_difference(own, rerun.recordings[trial]) or 1, len(list_texts_and_answers(own)) + 1
    try:
        while high - low > 1:
            middle = (low + high) // 2
            if rerun_from(middle).passes(criterion):
                low = middle
            else:
                high = middle
        passing, failing = rerun_from(low), rerun_from(high)
    except BudgetSpent:
        return None
    return (passing, failing) if passing.passes(criterion) and failing.loses(criterion) else None


def _differs(rerun: Rerun, trial: int) -> bool:
    return find_first_difference(rerun.originals[trial], rerun.recordings[trial]) is not None
