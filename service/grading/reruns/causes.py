"""Causes: for each criterion with lost marks, the smallest exchange with which a rerun does not lose them.

``cause_sentences.py`` describes a cause, from its reruns alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from service.grading.reruns.changed_lines import count_lost_marks, find_changed_line
from service.grading.reruns.engine import DEFAULT_BUDGET, Budget, BudgetSpent, Rerun, RerunEngine
from service.grading.reruns.exchanges import (
    ChangedLine,
    Exchange,
    MoreTime,
    OtherNoise,
    VisibleStart,
    WithoutChannelEffect,
    WithoutLightNoise,
    WithoutMessageLoss,
    WithoutMotorNoise,
    list_texts_and_answers,
)
from service.grading.reruns.halves import (
    decide_losing_parts,
    find_losing_answer,
    find_losing_parts,
    list_part_reruns,
    list_student_parts,
)
from service.grading.reruns.mildest import Conditions, find_mildest_failure, get_conditions, remove_conditions
from service.grading.run_plan import RunPlan
from sim.random_streams import RandomStream
from sim.recording import Recording, Verdict
from submissions.assignment.definition import Trial

#: The ingredient that was exchanged: parts of the submission, noise or messages, chance, time, a line of a part, or the
#: start pose; ``mildest`` are the mildest conditions with which a trial still fails.
CauseKind = Literal["parts", "conditions", "chance", "time", "line", "start", "mildest"]
Item = TypeVar("Item")
_OTHER_NOISES = 5
#: Keys of criteria whose expectation can depend on the start pose.
_EXPECTATIONS = frozenset({"truth", "expected"})
_MAX_CAUSES = 3


@dataclass(frozen=True, slots=True)
class Cause:
    """Why a criterion lost marks, and the reruns that prove it. ``is_hidden`` if any of their trials is hidden."""

    criterion: str
    kind: CauseKind
    reruns: tuple[Rerun, ...]
    is_hidden: bool = False


#: Finds causes of the lost marks of a criterion. It may raise BudgetSpent.
CauseFinder = Callable[[RerunEngine, str], Iterator[Cause]]


def find_causes(
    engine: RerunEngine,
    reference: RunPlan | None = None,
    finders: Sequence[CauseFinder] = (),
    budget: Budget = DEFAULT_BUDGET,
    explained: Collection[str] = (),
) -> tuple[Cause, ...]:
    """Return the causes of each criterion with lost marks, in the order of the criteria; at most three for each.

    Args:
        engine: The engine, for the trials that may be run again.
        reference: The plan of the reference, if there is one. The assignment says what of it may take the place of the
            student's.
        finders: Further searches, after those of this module.
        budget: What each criterion may cost.
        explained: The ids of criteria whose causes are known.

    Raises:
        HostError: The machine failed.
        Exception: Whatever the heartbeat of the engine raises.
    """
    main_finders = (_build_part_finder(reference), _find_conditions, _find_time)
    causes: list[Cause] = []
    for criterion in engine.assignment.criteria:
        if criterion.id not in engine.lost_criteria or not engine.can_judge(criterion.id):
            continue
        if criterion.id in explained or not engine.list_trials(criterion.id):
            continue
        engine.start_cause(budget)
        found_causes: list[Cause] = []
        try:
            for finder in (*main_finders, *finders):
                for cause in itertools.islice(finder(engine, criterion.id), _MAX_CAUSES - len(found_causes)):
                    found_causes.append(cause)  # at once, because the finder may use up the budget
            if all(each.kind == "parts" for each in found_causes):
                known_changes = _list_changed_lines(causes)
                found_causes = _add_line(engine, criterion.id, found_causes, known_changes, reference)
            if not found_causes:
                found_causes += _find_start(engine, criterion.id)
            if len(found_causes) < _MAX_CAUSES:
                found_causes += _find_mildest(engine, criterion.id)
        except BudgetSpent:
            pass
        causes += found_causes
    return tuple(_choose_best_line(each, causes) for each in causes)


def _build_cause(engine: RerunEngine, criterion: str, kind: CauseKind, *reruns: Rerun) -> Cause:
    is_hidden = any(engine.results[trial].visibility != "visible" for rerun in reruns for trial in rerun.trials)
    return Cause(criterion, kind, reruns, is_hidden)


def _build_part_finder(reference: RunPlan | None) -> CauseFinder:
    def find_part(engine: RerunEngine, criterion: str) -> Iterator[Cause]:
        parts = list_student_parts(engine.assignment)
        if reference is None or not engine.assignment.reruns.halves or len(parts) < 2:
            return
        if not engine.has_exchangeable_parts:
            return
        reruns = find_losing_parts(engine, criterion, parts, reference)
        if not reruns:
            return
        answer: tuple[Rerun, ...] = ()
        responder_rerun = reruns[parts.index("responder")] if "responder" in parts else None
        if responder_rerun is not None and responder_rerun.passes(criterion):
            answer = find_losing_answer(engine, criterion, responder_rerun, reference) or ()
        yield _build_cause(engine, criterion, "parts", *reruns, *answer)

    return find_part


def _find_conditions(engine: RerunEngine, criterion: str) -> Iterator[Cause]:
    """Yield the smallest set of noises and effects of the channel without which nothing is lost, then the chance."""
    trial = _choose_failed_trial(engine, criterion)
    conditions = _list_conditions(engine.trials[trial], engine.results[trial].recording)
    # One trial is enough to find the exchanges; all trials then show what they give.
    smallest = find_smallest(conditions, lambda exchanges: _rerun_trial_if_passing(engine, criterion, trial, exchanges))
    if smallest is None:
        return
    smallest = _rerun_if_passing(engine, criterion, smallest.exchanges) or smallest
    reruns = [smallest]
    if smallest.exchanges == (WithoutMessageLoss(),):
        messages = _list_lost_messages(engine.results[trial].recording)
        single = find_smallest(
            messages,
            lambda numbers: _check_trial(engine, criterion, trial, WithoutMessageLoss(frozenset(numbers))),
        )
        reruns += [] if single is None else [single]
    yield _build_cause(engine, criterion, "conditions", *reruns)
    if any(isinstance(each, WithoutLightNoise | WithoutMotorNoise) for each in smallest.exchanges):
        seeds = RandomStream(engine.trials[trial].seed, "other noise")
        others = [engine.rerun((trial,), (OtherNoise(seeds.integer(number)),)) for number in range(_OTHER_NOISES)]
        if any(each.passes(criterion) for each in others):
            yield _build_cause(engine, criterion, "chance", *others)


def _find_time(engine: RerunEngine, criterion: str) -> Iterator[Cause]:
    """Yield the time as the cause, if the trial ended at its limit and passes with more."""
    trial = _choose_failed_trial(engine, criterion)
    if engine.results[trial].verdict is Verdict.TIME_LIMIT:
        rerun = _rerun_if_passing(engine, criterion, (MoreTime(),))
        if rerun is not None:
            yield _build_cause(engine, criterion, "time", rerun)


def _add_line(
    engine: RerunEngine,
    criterion: str,
    part_causes: list[Cause],
    known_changes: Sequence[ChangedLine],
    reference: RunPlan | None,
) -> list[Cause]:
    """Return the causes with the line with which one change loses nothing, in the parts that lose the marks.

    One change does not show what is wrong with parts that do not fit together. The line takes the place of parts that
    still lose marks beside the reference's, because it shows that one of them is enough.
    """
    parts = [part for cause in part_causes for part in decide_losing_parts(cause.reruns, criterion)]
    single = [rerun for cause in part_causes for given, rerun in list_part_reruns(cause.reruns) if len(given) == 1]
    if len(parts) > 1 and any(rerun.passes(criterion) for rerun in single):
        return part_causes
    given = reference if engine.assignment.reruns.statements and engine.has_exchangeable_parts else None
    student_parts = list_student_parts(engine.assignment)
    rerun = find_changed_line(engine, criterion, parts or student_parts, known_changes, given)
    if rerun is None:
        return part_causes
    return [*(part_causes if len(parts) == 1 else ()), _build_cause(engine, criterion, "line", rerun)]


def _list_changed_lines(causes: Sequence[Cause]) -> list[ChangedLine]:
    exchanges = (each for cause in causes if cause.kind == "line" for rerun in cause.reruns for each in rerun.exchanges)
    return [each for each in exchanges if isinstance(each, ChangedLine)]


def _choose_best_line(cause: Cause, causes: Sequence[Cause]) -> Cause:
    """Return a cause with the line of another criterion, if this change passes too and loses fewer marks."""
    others = [each for each in causes if each.kind == cause.kind == "line" and each.reruns[0].passes(cause.criterion)]
    best = min((cause, *others), key=lambda each: count_lost_marks(each.reruns[0])) if others else cause
    return replace(best, criterion=cause.criterion)


def _find_start(engine: RerunEngine, criterion: str) -> Iterator[Cause]:
    """Yield the start pose as the cause, if a trial passes from the start of a visible trial that passed.

    Criteria that expect something else from each pose would be judged by what the original pose shows.
    """
    if _depends_on_pose(engine, criterion):
        return
    failed_trials = engine.list_failed_trials(criterion)
    for trial in failed_trials[:1]:
        definition = engine.trials[trial]
        for other in engine.list_trials(criterion):
            pose = engine.trials[other].pose
            if other in failed_trials or engine.results[other].visibility != "visible" or pose == definition.pose:
                continue
            rerun = engine.rerun((trial,), (VisibleStart(pose, other),))
            if rerun.passes(criterion):
                yield _build_cause(engine, criterion, "start", rerun)
            return


def _find_mildest(engine: RerunEngine, criterion: str) -> Iterator[Cause]:
    """Yield the mildest conditions with which a trial still fails: of noise, message loss and start pose."""
    schema = next(each for each in engine.assignment.criteria if each.id == criterion)
    failed_trials = engine.list_failed_trials(criterion) if schema.judges_each_trial else ()
    for trial in failed_trials[:1]:
        easy = _choose_easy_conditions(engine, criterion, trial)
        reruns = None if easy is None else find_mildest_failure(engine, criterion, trial, easy)
        if reruns is not None:
            yield _build_cause(engine, criterion, "mildest", *reruns)


def _choose_easy_conditions(engine: RerunEngine, criterion: str, trial: int) -> Conditions | None:
    """Return the trial's conditions without those that cause the loss, or those of a visible trial that passed."""
    hard = get_conditions(engine.trials[trial])
    conditions = _list_conditions(engine.trials[trial], engine.results[trial].recording)
    # These reruns are known already.
    smallest = find_smallest(conditions, lambda exchanges: _rerun_if_passing(engine, criterion, exchanges))
    if smallest is not None:
        return remove_conditions(hard, smallest.exchanges)
    failed_trials = engine.list_failed_trials(criterion)
    for other in engine.list_trials(criterion):
        if other not in failed_trials and engine.results[other].visibility == "visible":
            easy = get_conditions(engine.trials[other])
            return replace(easy, pose=hard.pose) if _depends_on_pose(engine, criterion) else easy
    return None


def _depends_on_pose(engine: RerunEngine, criterion: str) -> bool:
    """Return whether the criterion can expect something else from each start pose."""
    schema = next(each for each in engine.assignment.criteria if each.id == criterion)
    return bool(_EXPECTATIONS & type(schema).model_fields.keys())


def _choose_failed_trial(engine: RerunEngine, criterion: str) -> int:
    """Return the first trial that the criterion lost marks in; the first of all if it names none."""
    return next(iter((*engine.list_failed_trials(criterion), *engine.list_trials(criterion))))


def _list_conditions(trial: Trial, recording: Recording) -> tuple[Exchange, ...]:
    """Return an exchange for each noise and effect of the channel that the trial has."""
    channel = trial.channel
    conditions: list[Exchange] = []
    if trial.light_noise:
        conditions.append(WithoutLightNoise())
    if trial.motor_noise:
        conditions.append(WithoutMotorNoise())
    if not recording.messages:
        return tuple(conditions)
    if channel.loss:
        conditions.append(WithoutMessageLoss())
    if channel.duplication:
        conditions.append(WithoutChannelEffect("duplication"))
    if channel.reordering:
        conditions.append(WithoutChannelEffect("reordering"))
    if channel.corruption:
        conditions.append(WithoutChannelEffect("corruption"))
    if channel.jitter:
        conditions.append(WithoutChannelEffect("jitter"))
    return tuple(conditions)


def _list_lost_messages(recording: Recording) -> tuple[int, ...]:
    """Return the numbers, from 1, of the robot's texts that chance lost, or whose answers it lost."""
    return tuple(
        number
        for number, (text, answers) in enumerate(list_texts_and_answers(recording), start=1)
        if any(each.lost == "chance" for each in (text, *answers))
    )


def _rerun_if_passing(engine: RerunEngine, criterion: str, exchanges: Sequence[Exchange]) -> Rerun | None:
    rerun = engine.rerun_criterion(criterion, exchanges)
    return rerun if rerun.passes(criterion) else None


def _rerun_trial_if_passing(
    engine: RerunEngine, criterion: str, trial: int, exchanges: Sequence[Exchange]
) -> Rerun | None:
    if trial not in engine.list_failed_trials(criterion):
        return _rerun_if_passing(engine, criterion, exchanges)
    rerun = engine.rerun((trial,), exchanges)
    return rerun if rerun.passes(criterion) else None


def _check_trial(engine: RerunEngine, criterion: str, trial: int, exchange: Exchange) -> Rerun | None:
    rerun = engine.rerun((trial,), (exchange,))
    return rerun if rerun.passes(criterion) else None


def find_smallest(items: Sequence[Item], check: Callable[[Sequence[Item]], Rerun | None]) -> Rerun | None:
    """Return the rerun with a smallest set of exchanged items that passes; None if all items together don't.

    ``check`` returns the rerun with these items exchanged if it passes. Single items are tried first, in order; if none
    passes, items are removed from the set one after the other, as long as it passes without them.
    """
    best = check(items) if items else None
    if best is None or len(items) == 1:
        return best
    try:
        for item in items:
            single = check((item,))
            if single is not None:
                return single
        needed = list(items)
        for item in items:
            fewer = [each for each in needed if each is not item]
            rerun = check(fewer) if len(fewer) > 1 else None
            if rerun is not None:
                best, needed = rerun, fewer
    except BudgetSpent:
        return best  # it passes, but it may not be the smallest
    return best
