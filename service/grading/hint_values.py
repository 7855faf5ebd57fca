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
from service.language import translatable
from sim.sentences import Sentence, join_sentences
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
            yield Sentence(
                "%(place)s computes %(name)s, but no line uses it. Write %(name)s where its value is needed",
                place=listing.locate(statement.line),
                name=name,
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
        hint = Sentence(
            "%(place)s takes OUTPUT_C for the left motor, so the robot turns to the other side: the left motor is on "
            "OUTPUT_B. Write %(name)s(OUTPUT_B, OUTPUT_C).",
            place=listing.locate(statement.line),
            name=name,
        )
        yield (
            join_sentences(hint, Sentence("Line %(line)s has the same.", line=other_lines[0])) if other_lines else hint
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
        is_other_case = other_flag in missing_flags
        template = (
            translatable(
                "%(place)s: -%(flag)s takes a value, so %(value)s is its value and sets no flags. Write %(fixed)s"
            )
            if is_other_case
            else translatable(
                "%(place)s: -%(flag)s takes a value, so %(value)s is its value and sets no flags. Write %(fixed)s, and "
                "-%(flag)s with its value apart"
            )
        )
        fixed_flags = f"-{leading_flags}{other_flag if is_other_case else ''}{value}"
        place = listing.locate(magic_index + 1)
        yield Sentence(template, place=place, flag=flag, value=value, fixed=fixed_flags)
        return


def hint_about_few_samples(clues: Clues) -> Iterator[str]:
    """Yield a hint on a log with too few samples, which may explain its other errors."""
    # A robot that stopped too early could not log enough.
    has_stopping_criterion = any(isinstance(each, StopOn) for each in clues.lost)
    for criterion in () if has_stopping_criterion else clues.lost:
        count = clues.find_measures(criterion).get("samples") if isinstance(criterion, Datalog) else None
        if not count or not isinstance(criterion, Datalog) or not count < criterion.at_least:
            continue
        sleeping_loops = _collect_sleeping_loops(clues)
        if len(sleeping_loops) == 1:
            listing, statement, seconds = sleeping_loops[0]
            yield Sentence(
                "%(place)s: only %(count)g samples were logged, and at least %(least)s are asked for. The loop waits "
                "%(seconds)g s after each of them: wait less, and let the loop repeat more often",
                place=listing.locate(statement.line),
                count=count,
                least=criterion.at_least,
                seconds=seconds,
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
        yield Sentence(
            "%(place)s: the robot passed the patterns in %(seconds).1f s and took only %(count)g pairs of "
            "images. Drive slower, or take images more often",
            place=listing.locate(statement.line),
            seconds=clues.seconds,
            count=measures["pairs"],
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
            yield Sentence(
                "%(place)s: the loop ends when the edge of the sensor leaves the white area: it read "
                "%(reading).2f %%, expected %(least)g to %(most)g %%. Let the robot drive on a little "
                "after the loop, for example with time.sleep(0.2)",
                place=listing.locate(statement.line),
                reading=other_reading.reading,
                least=minimum,
                most=maximum,
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
                yield Sentence(
                    "%(place)s: atan2 takes y first, and then x. For the angle from the x axis write "
                    "%(name)s(%(y)s, %(x)s)",
                    place=listing.locate(statement.line),
                    name=call.name,
                    y=y,
                    x=x,
                )
                return
