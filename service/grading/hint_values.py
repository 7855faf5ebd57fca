"""Hints on unused or misplaced values: unread variables, swapped ports and flags.

The program text shows each of them. They apply only if visible criteria lost marks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from service.grading.findings import MissingSwitches, OtherReading
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name, join_tokens
from service.grading.hint_motion import STOPPING_CRITERIA
from service.grading.hint_structure import DRIVING_CRITERIA, collect_statements
from service.grading.hint_tables import PROPERTIES
from submissions.criteria.collecting import Collects
from submissions.criteria.logs import Datalog
from submissions.criteria.stopping import StopOn

_OPERATORS = frozenset("+-*/")
_PAIRS = frozenset({"MoveTank", "MoveSteering"})
_SWAPPED_PORTS = ("OUTPUT_C", ",", "OUTPUT_B")
#: A flag that takes a value, and the value after it.
_VALUED_FLAG = re.compile(r"(?<=\s)-(\w*?)([broxyaPNMs])([A-Za-z]{2,})(?=\s|$)")
_X_NAME = re.compile(r"(?:\w*_)?d?x\d?\Z", re.IGNORECASE)
_Y_NAME = re.compile(r"(?:\w*_)?d?y\d?\Z", re.IGNORECASE)


def hint_about_unused_value(clues: Clues) -> Iterator[str]:
    """Yield a hint on a value that is computed but never used."""
    for listing, statement in collect_statements(clues):
        name, value = statement.target, statement.tokens[2:]
        is_computed = name and (_OPERATORS & set(value) or value[-1] in PROPERTIES) and name not in value
        if is_computed and not any(_is_name_used(one, name) for one in listing.code.statements):
            yield (
                f"{listing.locate(statement.line)} computes {name}, but no line uses it. Write {name} where its value "
                "is needed"
            )
            return


def _is_name_used(statement: Statement, name: str) -> bool:
    """Return whether a statement uses a name apart from its assignment, including in f-strings."""
    tokens = statement.tokens[2:] if statement.target == name else statement.tokens
    return any(token == name or (not is_name(token) and name in token) for token in tokens)


def hint_about_swapped_ports(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``MoveTank(OUTPUT_C, OUTPUT_B)``: the left motor, on B, must come first."""
    if not any(isinstance(each, DRIVING_CRITERIA + STOPPING_CRITERIA) for each in clues.lost):
        return
    calls = [(listing, each, call.name) for listing, each in collect_statements(clues) for call in each.calls]
    swapped_calls = [
        (listing, each, name)
        for listing, each, name in calls
        if name.rpartition(".")[2] in _PAIRS and "".join(_SWAPPED_PORTS) in "".join(each.tokens)
    ]
    if swapped_calls:
        listing, statement, name = swapped_calls[0]
        other_lines = [one.line for _, one, _ in swapped_calls[1:]]
        lines_sentence = f" Line {other_lines[0]} has the same." if other_lines else ""
        yield (
            f"{listing.locate(statement.line)} takes OUTPUT_C for the left motor, so the robot turns to the other "
            f"side: the left motor is on OUTPUT_B. Write {name}(OUTPUT_B, OUTPUT_C).{lines_sentence}"
        )


def hint_about_swallowed_flags(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``-oAHWR``: the flag takes a value, so the flags after it become its value."""
    missing_switches = (found for each in clues.lost if (found := clues.find_finding(each, MissingSwitches)))
    missing_flags = {letter for each in missing_switches for letter in each.letters}
    for listing in clues.programs if missing_flags else ():
        magic_index = listing.magic_place
        match = _VALUED_FLAG.search(listing.lines[magic_index]) if magic_index is not None else None
        if magic_index is None or match is None or not missing_flags & set(match[3]):
            continue
        leading_flags, flag, value = match.groups()
        other_flag = flag.swapcase()
        advice = (
            f"-{leading_flags}{other_flag}{value}"
            if other_flag in missing_flags
            else f"-{leading_flags}{value}, and -{flag} with its value apart"
        )
        yield (
            f"{listing.locate(magic_index + 1)}: -{flag} takes a value, so {value} is its value and sets no flags. "
            f"Write {advice}"
        )
        return


def hint_about_few_samples(clues: Clues) -> Iterator[str]:
    """Yield a hint on a log with too few samples, which may explain its other errors."""
    # A robot that stopped too early could not log enough.
    has_stopping_criterion = any(isinstance(each, StopOn) for each in clues.lost)
    for criterion in () if has_stopping_criterion else clues.lost:
        count = clues.find_measures(criterion).get("samples") if isinstance(criterion, Datalog) else None
        if not count or not isinstance(criterion, Datalog) or not count < criterion.at_least:
            continue
        sentence = f"only {count:g} samples were logged, and at least {criterion.at_least} are asked for"
        sleeping_loops = _collect_sleeping_loops(clues)
        if len(sleeping_loops) == 1:
            listing, statement, seconds = sleeping_loops[0]
            yield (
                f"{listing.locate(statement.line)}: {sentence}. The loop waits {seconds:g} s after each of them: wait "
                "less, and let the loop repeat more often"
            )
            return


def _collect_sleeping_loops(clues: Clues) -> list[tuple[Listing, Statement, float]]:
    """Return the statements that sleep in a printing loop, with their seconds."""
    sleeping_loops = []
    for listing, statement in collect_statements(clues):
        call = next((one for one in statement.calls if one.name in ("time.sleep", "sleep")), None)
        seconds = listing.code.number(call.arguments[0]) if call is not None and call.arguments else None
        loops = listing.code.list_enclosing_loops(statement)
        if (
            seconds
            and loops
            and any(one.name == "print" for other in listing.code.list_body(loops[0]) for one in other.calls)
        ):
            sleeping_loops.append((listing, statement, seconds))
    return sleeping_loops


def hint_about_few_images(clues: Clues) -> Iterator[str]:
    """Yield a hint on a robot that is too fast to take enough images of its patterns."""
    for criterion in clues.lost:
        measures = clues.find_measures(criterion)
        class_counts = [count for name, count in measures.items() if name.startswith("different: ")]
        has_few_images = isinstance(criterion, Collects) and min(class_counts, default=math.inf) < criterion.each
        drive_statements = [
            (listing, each)
            for listing, each in collect_statements(clues)
            if any(call.name.endswith(".on") and call.arguments for call in each.calls)
        ]
        if not has_few_images or not measures["pairs"] or len(drive_statements) != 1 or clues.seconds > clues.limit / 4:
            continue
        listing, statement = drive_statements[0]
        yield (
            f"{listing.locate(statement.line)}: the robot passed the patterns in {clues.seconds:.1f} s and took only "
            f"{measures['pairs']:g} pairs of images. Drive slower, or take images more often"
        )
        return


def hint_about_partial_reading(clues: Clues) -> Iterator[str]:
    """Yield a hint on a robot that stops when only the edge of its sensor is on the target."""
    for criterion in clues.lost:
        other_reading = clues.find_finding(criterion, OtherReading)
        if other_reading is None or not isinstance(criterion, StopOn) or criterion.reflected is None:
            continue
        minimum, maximum = criterion.reflected
        if minimum == maximum or not maximum < other_reading.reading < 100:
            continue
        loops = [
            (listing, each)
            for listing, each in collect_statements(clues)
            if each.keyword == "while" and any(token in PROPERTIES for token in each.condition)
        ]
        if len(loops) == 1:
            listing, statement = loops[0]
            yield (
                f"{listing.locate(statement.line)}: the loop ends when the edge of the sensor leaves the white area: "
                f"it read {other_reading.reading:.2f} %, expected {minimum:g} to {maximum:g} %. Let the robot drive on "
                "a little after the loop, for example with time.sleep(0.2)"
            )
            return


def hint_about_swapped_atan2(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``math.atan2(dx, dy)``, if the robot misses its target."""
    if not any(isinstance(each, DRIVING_CRITERIA + STOPPING_CRITERIA) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        for call in statement.calls:
            if call.name.rpartition(".")[2] != "atan2" or len(call.arguments) != 2:
                continue
            first_names, second_names = ([token for token in one if is_name(token)] for one in call.arguments)
            if (
                first_names
                and second_names
                and all(map(_X_NAME.match, first_names))
                and all(map(_Y_NAME.match, second_names))
            ):
                y, x = join_tokens(call.arguments[1]), join_tokens(call.arguments[0])
                yield (
                    f"{listing.locate(statement.line)}: atan2 takes y first, and then x. For the angle from the x axis "
                    f"write {call.name}({y}, {x})"
                )
                return
