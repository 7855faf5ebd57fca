"""Hints from counterfactual runs: which single number, or which two lines exchanged, would have met the criterion.

Each line that moves the robot is scaled in the recorded path, then each two lines that follow each other are exchanged.
The criterion is judged on the changed path. Nothing is simulated, so this applies only to programs that drive without
sensors. Only visible trials are used.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from service.grading.grade import TrialResult
from service.grading.hint_clues import Clues, Listing, build_listing, describe_first_failure
from service.grading.hint_code import CallInCode, Statement
from service.grading.hint_structure import has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, LIMITED_MOVES, PROPERTIES
from service.grading.judging.judge import JUDGES
from service.grading.judging.judge_declaration import Case, StaticAnalysis
from sim.recording import Pose, Recording
from sim.sentences import Sentence, make_clause
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.criteria.drawing import Drawing
from submissions.criteria.ending import EndPose
from submissions.criteria.motion import Displacement, Excursions, Moves
from submissions.criteria.path import KeepsOut, Visits
from submissions.criteria.point import Circuits
from submissions.submission import PART_FILES

#: Criteria that depend on the path alone.
_PATH_CRITERIA = (Circuits, Displacement, Drawing, EndPose, Excursions, KeepsOut, Moves, Visits)
#: Factors to try: the opposite direction, then from the nearest to the farthest.
_ROUND_FACTORS = (1 / 3, 0.5, 2 / 3, 0.75, 0.8, 1.25, 4 / 3, 1.5, 2, 3)
_STEP_FACTORS = (1.06**step for step in range(-28, 29) if step)
_FACTORS = tuple(sorted((*_STEP_FACTORS, *_ROUND_FACTORS), key=lambda each: abs(math.log(each))))
_MAX_TICKS = 250_000
_MAX_LINES = 6
_MIN_PASS_SHARE = 0.999
#: Readings of the robot's own wheels and gyro, which scale with its path. The others depend on where the robot is.
_OWN_READINGS = frozenset({"angle", "position"})


@dataclass(frozen=True, slots=True)
class _Change:
    """Ticks of one line in each trial. ``line`` has the number to change."""

    listing: Listing
    statement: Statement
    call: CallInCode | None
    ticks: tuple[np.ndarray, ...]


def hint_about_wrong_number(clues: Clues) -> Iterator[str]:
    """Yield the line and the number that would have met the criterion that lost most."""
    listing = next(iter(clues.programs), None)
    criterion = next((each for each in clues.costliest_criteria if isinstance(each, _PATH_CRITERIA)), None)
    if listing is None or criterion is None or criterion is not clues.costliest_criteria[0] or clues.definition is None:
        return
    failure = describe_first_failure(clues, criterion)
    if not failure:  # only hidden trials lost marks
        return
    definition, trials = clues.definition, _collect_path_trials(criterion, clues.shown, listing)
    if not trials:
        return
    best = _find_best_change(definition, criterion, trials, listing)
    if best is not None:
        yield _describe_change(*best, failure)
        return
    ticks = sum(len(each.recording.ticks) for each in trials)
    for first, second, order in _collect_exchanges(listing, trials)[: min(_MAX_LINES, _MAX_TICKS // max(ticks, 1))]:
        exchanged = [replace(each, recording=_reorder_motion(each.recording, order)) for each in trials]
        if _has_full_marks(criterion, definition, exchanged):
            yield Sentence(
                "%(place)s: %(problem)s. Lines %(line)s and %(other_line)s are in the wrong order: exchange them",
                place=listing.locate(first.line),
                problem=make_clause(failure),
                line=first.line,
                other_line=second.line,
            )
            return


def find_scaled_line(
    program: str, definition: Assignment, criterion: Criterion, trials: Sequence[TrialResult]
) -> tuple[int, float] | None:
    """Return a line of a program and the factor of its motion with which the recorded paths would meet the criterion.

    The factor is negative for the opposite direction. None if the search does not apply, or finds none.
    """
    if not isinstance(criterion, _PATH_CRITERIA):
        return None
    listing = build_listing(PART_FILES["program"], "program", program)
    best = _find_best_change(definition, criterion, _collect_path_trials(criterion, trials, listing), listing)
    return None if best is None else (best[0].statement.line, best[1])


def _collect_path_trials(criterion: Criterion, shown: Sequence[TrialResult], listing: Listing) -> list[TrialResult]:
    """Return the trials of the criterion; empty if their paths depend on more than the program's numbers."""
    trials = [each for each in shown if not criterion.scenarios or each.scenario in criterion.scenarios]
    is_unfit = any(each.recording.partner is not None or not each.recording.places for each in trials)
    return (
        []
        if is_unfit or any(each.has_token(*(PROPERTIES - _OWN_READINGS)) for each in listing.code.statements)
        else trials
    )


def _find_best_change(
    definition: Assignment, criterion: Criterion, trials: list[TrialResult], listing: Listing
) -> tuple[_Change, float] | None:
    """Return the change and the factor with full marks for the criterion that gives the most marks together."""
    if not trials:
        return None
    visible_criteria = [each for each in definition.criteria if each.visibility == "visible"]
    path_criteria = [each for each in visible_criteria if isinstance(each, _PATH_CRITERIA)]
    remaining_ticks = _MAX_TICKS
    ticks = sum(len(each.recording.ticks) for each in trials)
    current_marks = [_compute_marks(each, definition, trials) for each in path_criteria]
    best: tuple[float, float, _Change, float] | None = None
    for change in list(_collect_changes(listing, trials))[:_MAX_LINES]:
        passing_factors = []
        for factor in (-1.0, *_FACTORS):
            remaining_ticks -= ticks
            if remaining_ticks < 0:
                break
            if _has_full_marks(criterion, definition, _apply_change(trials, change, factor)):
                passing_factors.append(factor)
        if not passing_factors:
            continue
        factor = _choose_factor(passing_factors)
        changed_trials = _apply_change(trials, change, factor)
        marks = [_compute_marks(each, definition, changed_trials) for each in path_criteria]
        if any(new < old for new, old in zip(marks, current_marks, strict=True)):
            continue  # it would lose marks that the program has
        total = sum(marks)
        size = abs(math.log(abs(factor))) + (factor < 0)
        if best is None or (-total, size) < best[:2]:
            best = -total, size, change, factor
    return None if best is None else best[2:]


def _choose_factor(passing_factors: list[float]) -> float:
    """Return the middle of the passing factors beside the nearest one, or -1 if only the opposite direction passes."""
    positive_factors = sorted(each for each in passing_factors if each > 0)
    if not positive_factors:
        return -1.0
    nearest_factor = min(positive_factors, key=lambda each: abs(math.log(each)))
    min_factor = max_factor = nearest_factor
    while any(abs(each / min_factor - 1 / 1.06) < 0.01 for each in positive_factors):
        min_factor /= 1.06
    while any(abs(each / max_factor - 1.06) < 0.01 for each in positive_factors):
        max_factor *= 1.06
    # Far from the borders of a wide range, but not farther from the student's number than necessary.
    return (
        min(math.sqrt(min_factor * max_factor), nearest_factor * 1.2)
        if nearest_factor > 1
        else max(math.sqrt(min_factor * max_factor), nearest_factor / 1.2)
    )


def _collect_changes(listing: Listing, trials: list[TrialResult]) -> Iterator[_Change]:
    """Yield the lines that moved the robot: single calls in functions first, then each moving line."""
    code = listing.code
    has_own_readings = any(each.has_token(*_OWN_READINGS) for each in code.statements)
    inner_lines, outer_lines = zip(*(_find_lines_at_ticks(each.recording) for each in trials), strict=True)
    known_keys: set[bytes] = set()
    for lines in (outer_lines, inner_lines):
        for line in dict.fromkeys(int(each) for each in np.concatenate(lines)):
            statement = code.find_statement(line)
            ticks = tuple(each == line for each in lines)
            key = b"".join(each.tobytes() for each in ticks)
            if statement is None or key in known_keys or not _has_moved(trials, ticks):
                continue
            # The number of such a loop is in its condition, and not in the line that waits.
            loops = (each for each in (statement, *code.list_enclosing(statement)) if each.keyword == "while")
            if has_own_readings and any(loops):
                continue
            known_keys.add(key)
            if lines is inner_lines and not (
                has_motor_call(statement, LIMITED_MOVES | CONTINUOUS_MOVES) or _is_sleep(statement)
            ):
                continue
            call = next((each for each in statement.calls if _list_numbers(listing, each)), None)
            yield _Change(listing, statement, call, ticks)


def _collect_exchanges(listing: Listing, trials: list[TrialResult]) -> list[tuple[Statement, Statement, np.ndarray]]:
    """Return pairs of moving lines that follow each other, and the order of the ticks if they were exchanged.

    Empty for several trials, whose ticks differ.
    """
    if len(trials) > 1:
        return []
    _, lines = _find_lines_at_ticks(trials[0].recording)
    borders = [0, *(np.flatnonzero(np.diff(lines)) + 1), len(lines)]
    runs = list(itertools.pairwise(int(each) for each in borders))
    exchanges = []
    for (start, middle), (_, end) in itertools.pairwise(runs):
        first, second = (listing.code.find_statement(int(lines[at])) for at in (start, middle))
        is_together = first is not None and second is not None and first.parent == second.parent == -1
        if first is not None and second is not None and is_together and first.tokens != second.tokens:
            order = np.arange(len(lines))
            order[start:end] = np.concatenate([order[middle:end], order[start:middle]])
            exchanges.append((first, second, order))
    return exchanges


def _find_lines_at_ticks(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return the innermost and the outermost line that ran during each tick."""
    starts = np.array([each.t for each in recording.places])
    place_indices = np.maximum(np.searchsorted(starts, recording.ticks.t - 1e-6, side="right") - 1, 0)
    places = np.array([(each.line, each.outer) for each in recording.places])[place_indices]
    return np.where(places[:, 1] > 0, places[:, 0], 0), places[:, 1]


def _has_moved(trials: list[TrialResult], ticks: tuple[np.ndarray, ...]) -> bool:
    steps = (_compute_steps(each.recording)[among] for each, among in zip(trials, ticks, strict=True))
    return any(bool(np.abs(each).max(initial=0) > 1e-6) for each in steps)


def _compute_steps(recording: Recording) -> np.ndarray:
    """Return forward, sideways and turn of each tick, in the robot's frame at the tick's start. Shape (n, 3)."""
    start, ticks = recording.start, recording.ticks
    x, y = np.diff(ticks.x, prepend=start.x), np.diff(ticks.y, prepend=start.y)
    headings = np.radians(np.concatenate([[start.heading], ticks.heading[:-1]]))
    turn = np.diff(ticks.heading, prepend=start.heading)
    forward, sideways = x * np.cos(headings) + y * np.sin(headings), y * np.cos(headings) - x * np.sin(headings)
    return np.stack([forward, sideways, turn], axis=1)


def _apply_change(trials: list[TrialResult], change: _Change, factor: float) -> list[TrialResult]:
    return [
        replace(each, recording=_scale_motion(each.recording, ticks, factor))
        for each, ticks in zip(trials, change.ticks, strict=True)
    ]


def _scale_motion(recording: Recording, selected_ticks: np.ndarray, factor: float) -> Recording:
    """Return the recording with the motion of some ticks scaled."""
    steps = _compute_steps(recording)
    steps[selected_ticks] *= factor
    scale = np.where(selected_ticks, factor, 1.0)
    left, right = (np.diff(each, prepend=0.0) * scale for each in _list_wheel_positions(recording))
    return _rebuild_path(recording, steps, left, right)


def _reorder_motion(recording: Recording, order: np.ndarray) -> Recording:
    """Return the recording with the motion of its ticks in another order."""
    left, right = (np.diff(each, prepend=0.0)[order] for each in _list_wheel_positions(recording))
    return _rebuild_path(recording, _compute_steps(recording)[order], left, right)


def _list_wheel_positions(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    return recording.ticks.left_position, recording.ticks.right_position


def _rebuild_path(recording: Recording, steps: np.ndarray, left: np.ndarray, right: np.ndarray) -> Recording:
    """Return the recording with the path that follows from the steps of the robot and of its wheels."""
    start, ticks = recording.start, recording.ticks
    heading = start.heading + np.cumsum(steps[:, 2])
    headings_before = np.radians(np.concatenate([[start.heading], heading[:-1]]))
    x = start.x + np.cumsum(steps[:, 0] * np.cos(headings_before) - steps[:, 1] * np.sin(headings_before))
    y = start.y + np.cumsum(steps[:, 0] * np.sin(headings_before) + steps[:, 1] * np.cos(headings_before))
    end = Pose(float(x[-1]), float(y[-1]), float(heading[-1]))
    changed_ticks = replace(
        ticks, x=x, y=y, heading=heading, left_position=np.cumsum(left), right_position=np.cumsum(right)
    )
    return replace(recording, ticks=changed_ticks, end=end)


def _has_full_marks(criterion: Criterion, definition: Assignment, trials: list[TrialResult]) -> bool:
    return _compute_marks(criterion, definition, trials) >= _MIN_PASS_SHARE * float(criterion.marks)


def _compute_marks(criterion: Criterion, definition: Assignment, trials: list[TrialResult]) -> float:
    """Return the marks of a criterion for changed trials; 0 if it looks at none of them."""
    is_relevant = any(not criterion.scenarios or each.scenario in criterion.scenarios for each in trials)
    if not is_relevant:
        return 0.0
    case = Case(definition, trials, StaticAnalysis(), {})
    return float(JUDGES[type(criterion)].judge(criterion, case).marks)


def _is_sleep(statement: Statement) -> bool:
    return any(call.name.rpartition(".")[2] == "sleep" for call in statement.calls)


def _list_numbers(listing: Listing, call: CallInCode) -> list[float]:
    """Return the numbers that a call is given."""
    numbers = (listing.code.number(each) for each in call.arguments)
    return [each for each in numbers if each is not None]


def _describe_change(change: _Change, factor: float, failure: str) -> str:
    location = change.listing.locate(change.statement.line)
    amount = _find_amount(change.listing, change.call) if change.call is not None else None
    if factor < 0:
        fix: str = Sentence("Let the robot move the other way here: change the sign of the speed or steering")
    elif amount:
        fix = suggest_number(amount, amount * factor)
    elif change.call is not None and (constant := _find_constant(change.listing, change.call)) is not None:
        line, name, present, is_divisor = constant
        fix = Sentence(
            "Change %(name)s in line %(line)s from %(present)g to about %(better)s",
            name=name,
            line=line,
            present=present,
            better=format_rounded(present / factor if is_divisor else present * factor),
        )
    elif factor > 1:
        fix = Sentence(
            "Let the robot move about %(factor).2g times as far or turn as much here, more than now", factor=factor
        )
    else:
        fix = Sentence(
            "Let the robot move about %(factor).2g times as far or turn as much here, less than now", factor=factor
        )
    return Sentence("%(place)s: %(problem)s. %(advice)s", place=location, problem=make_clause(failure), advice=fix)


def _find_amount(listing: Listing, call: CallInCode) -> float | None:
    """Return the number in a call that scales its motion: the last of a limited move or a wait, else the only one."""
    if call.name.rpartition(".")[2] in LIMITED_MOVES | {"sleep"}:
        return listing.code.number(call.arguments[-1]) if call.arguments else None
    numbers = _list_numbers(listing, call)
    return numbers[0] if len(numbers) == 1 else None


def _find_constant(listing: Listing, call: CallInCode) -> tuple[int, str, float, bool] | None:
    """Return the line, the name and the number of the constant that scales a limited move, and if it divides."""
    tokens = call.arguments[-1] if call.arguments and call.name.rpartition(".")[2] in LIMITED_MOVES else ()
    if len(tokens) != 3 or tokens[1] not in ("*", "/"):
        return None
    for name in (tokens[2],) if tokens[1] == "/" else (tokens[0], tokens[2]):
        definition = next((each for each in listing.code.statements if each.target == name), None)
        number = listing.code.number((name,))
        if definition is not None and number:
            return definition.line, name, number, tokens[1] == "/"
    return None


def suggest_number(present: float, better: float) -> str:
    """Return advice to change a number to about a better one."""
    return Sentence("Change %(present)g to about %(better)s", present=present, better=format_rounded(better))


def format_rounded(number: float) -> str:
    """Return a number with as many digits as a student would choose."""
    return f"{number:.0f}" if abs(number) >= 20 else f"{number:.2g}"
