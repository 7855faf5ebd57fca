"""Hints on sensor loops that end at once, because their condition is false from the start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement, is_name, join_tokens
from service.grading.hint_loops import describe_reading
from service.grading.hint_structure import collect_statements, has_motor_call
from service.grading.hint_tables import CONTINUOUS_MOVES, PROPERTIES, READINGS
from sim.sentences import Sentence

_IMMEDIATE_SECONDS = 0.5
_OWN_READINGS = frozenset({"position", "angle"})


def hint_about_skipped_loop(clues: Clues) -> Iterator[str]:
    """Yield a hint on a sensor loop whose condition is false at the start, so the robot stops immediately."""
    if clues.seconds <= _IMMEDIATE_SECONDS and not any(True for _ in clues.faults):
        yield from (hint for _, hint in describe_skipped_loops(clues))


def describe_skipped_loops(clues: Clues) -> Iterator[tuple[str, str]]:
    """Yield why the first sensor loop after the motors are switched on ends immediately, and the same with a fix."""
    for listing, statement in collect_statements(clues):
        reading = next((token for token in statement.condition if token in PROPERTIES), "")
        is_driving = any(
            has_motor_call(other, CONTINUOUS_MOVES) for other in listing.code.statements[: statement.number]
        )
        if statement.keyword == "while" and reading and is_driving:
            explain = _explain_early_end if _is_true_at_zero(listing, statement) else _explain_skipped_loop
            yield explain(listing, statement, reading)
            return


def _is_true_at_zero(listing: Listing, loop: Statement) -> bool:
    """Return whether a loop compares what the wheels or the gyro read, which is 0 at the start, so that it runs."""
    tokens = loop.condition
    index = next((at for at, token in enumerate(tokens) if token in ("<", "<=", ">", ">=")), None)
    if index is None or not set(tokens[:index]) & _OWN_READINGS or {"-", "and", "or", "not"} & set(tokens):
        return False
    limit = listing.code.number(tokens[index + 1 :])
    return limit is not None and (limit > 0 if tokens[index][0] == "<" else limit < 0)


def _explain_early_end(listing: Listing, loop: Statement, reading: str) -> tuple[str, str]:
    """Return why a loop ends after its first passes, twice."""
    explanation = Sentence(
        "%(place)s: the loop ends early, as soon as %(condition)s is false. %(range)s. Check the number",
        place=listing.locate(loop.line),
        condition=join_tokens(loop.condition),
        range=describe_reading(reading),
    )
    return explanation, explanation


def _explain_skipped_loop(listing: Listing, loop: Statement, reading: str) -> tuple[str, str]:
    """Return why a loop ends immediately, and the same with the fix that its condition suggests."""
    place, condition = listing.locate(loop.line), join_tokens(loop.condition)
    unbracketed_fix = describe_unbracketed_not(loop.condition)
    if unbracketed_fix:
        explanation = Sentence(
            "%(place)s: the loop ends at once, because %(condition)s is false from the start. %(fix)s",
            place=place,
            condition=condition,
            fix=unbracketed_fix,
        )
        return explanation, explanation
    flag = loop.condition[1] if loop.condition[0] == "not" and len(loop.condition) == 2 else ""
    decision = next((each for each in listing.code.list_body(loop) if flag and each.target == flag), None)
    if decision is not None:
        explanation = Sentence(
            "%(place)s: the loop ends at once, because %(condition)s is false in its second pass. Line %(line)s makes "
            "%(flag)s true at the first reading. Print the values in %(code)s, and check the condition",
            place=place,
            condition=condition,
            line=decision.line,
            flag=flag,
            code=join_tokens(decision.tokens[2:]),
        )
        if not _reads_red_alone(decision):
            return explanation, explanation
        return explanation, Sentence(
            "%(hint)s: white has much red, green and blue. Compare red with green", hint=explanation
        )
    if reading in READINGS:
        explanation = Sentence(
            "%(place)s: the loop ends at once, because %(condition)s is false from the start. %(range)s. Check the "
            "number",
            place=place,
            condition=condition,
            range=describe_reading(reading),
        )
    else:
        explanation = Sentence(
            "%(place)s: the loop ends at once, because %(condition)s is false from the start. Check the number",
            place=place,
            condition=condition,
        )
    is_single_comparison = not any(token in ("and", "or", "not") for token in loop.condition)
    opposite = condition.replace("<", ">") if "<" in condition else condition.replace(">", "<")
    if is_single_comparison and opposite != condition:
        return explanation, Sentence("%(hint)s, or write %(condition)s", hint=explanation, condition=opposite)
    return explanation, Sentence("%(hint)s, and each part of the condition", hint=explanation)


def describe_unbracketed_not(condition: Sequence[str]) -> str:
    """Return the fix of ``not red > 200 and green < 50``, where ``not`` counts for the first part only."""
    if len(condition) < 2 or condition[0] != "not" or condition[1] == "(":
        return ""
    end = next((place for place, token in enumerate(condition) if token in ("and", "or")), None)
    if end is None or not any(token in ("<", ">", "<=", ">=", "==", "!=") for token in condition[:end]):
        return ""
    return Sentence(
        "not counts only for %(part)s. If it is meant for both parts, write not (%(whole)s)",
        part=join_tokens(condition[1:end]),
        whole=join_tokens(condition[1:]),
    )


def _reads_red_alone(statement: Statement) -> bool:
    """Return whether a condition compares only the red part of a colour with a number."""
    names = {token for token in statement.tokens[2:] if is_name(token)}
    return bool(names) and names <= {"r", "red", "colorLeft", "colorRight"}
