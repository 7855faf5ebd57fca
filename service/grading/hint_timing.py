"""Hints on programs that wait too little, read a sensor too rarely, or speak before the last text has ended.

Each rule compares a number in the program with the recordings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.grading.findings import HurriedSpeech, LateResend
from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement
from service.grading.hint_motion import STOPPING_CRITERIA
from service.grading.hint_slips import format_arguments
from service.grading.hint_structure import collect_statements
from service.grading.hint_tables import PROPERTIES
from sim.sentences import Sentence

_RARE_READING_SECONDS = 0.5


def hint_about_overlapping_speech(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``say`` without ``wait=True``, if the text must be spoken to its end."""
    if not any(clues.find_finding(each, HurriedSpeech) for each in clues.lost):
        return
    for listing, statement in collect_statements(clues):
        for call in statement.calls:
            if call.name == "say" and call.arguments and not any("wait" in one for one in call.arguments):
                yield Sentence(
                    "%(place)s: the program continues before the words are spoken. Write say(%(arguments)s, wait=True)",
                    place=listing.locate(statement.line),
                    arguments=format_arguments(call.arguments),
                )
                return


def hint_about_short_waits(clues: Clues) -> Iterator[str]:
    """Yield a hint on a wait for an answer that is shorter than the answer takes."""
    if not any(clues.find_finding(each, LateResend) for each in clues.lost):
        return
    answer_seconds = _measure_fastest_answer(clues)
    for listing, statement in collect_statements(clues):
        number = _find_sleep_seconds(listing, statement)
        if number is not None and number < answer_seconds and listing.code.list_enclosing_loops(statement):
            yield Sentence(
                "%(place)s waits %(number)g s, but an answer takes %(seconds).2g s. Wait longer, for example "
                "%(longer)g s",
                place=listing.locate(statement.line),
                number=number,
                seconds=answer_seconds,
                longer=max(0.5, math.ceil(20 * answer_seconds) / 10),
            )
            return


def hint_about_rare_readings(clues: Clues) -> Iterator[str]:
    """Yield a hint on a loop that reads a sensor so rarely that the robot drives past its target."""
    if not _has_lost_criterion(clues, *STOPPING_CRITERIA) or clues.is_stationary:
        return
    for listing, statement in collect_statements(clues):
        number = _find_sleep_seconds(listing, statement)
        loop = next((one for one in listing.code.list_enclosing_loops(statement) if one.keyword == "while"), None)
        if number is None or number < _RARE_READING_SECONDS or loop is None:
            continue
        body = listing.code.list_body(loop)
        has_reading = any(token in PROPERTIES for one in (loop, *body) for token in one.tokens)
        if has_reading and statement.parent == loop.number:
            distance = _measure_top_speed(clues) * number
            yield Sentence(
                "%(place)s: the loop reads the sensor only every %(seconds)g s, and the robot drives about "
                "%(distance).0f mm in that time. Wait less, for example time.sleep(0.05)",
                place=listing.locate(statement.line),
                seconds=number,
                distance=distance,
            )
            return


def _has_lost_criterion(clues: Clues, *kinds: type) -> bool:
    return any(isinstance(each, kinds) for each in clues.lost)


def _find_sleep_seconds(listing: Listing, statement: Statement) -> float | None:
    """Return how many seconds a statement sleeps; None if it does not sleep or the number is unclear."""
    call = next((each for each in statement.calls if each.name in ("time.sleep", "sleep")), None)
    return listing.code.number(call.arguments[0]) if call is not None and call.arguments else None


def _measure_fastest_answer(clues: Clues) -> float:
    """Return the shortest time from a message to its answer, in seconds; 0 if there are no answers."""
    answer_times = (
        message.delivered - recording.messages[message.reply_to].t
        for recording in clues.recordings
        for message in recording.messages
        if message.reply_to is not None and message.delivered is not None and message.sender == "responder"
    )
    return min(answer_times, default=0.0)


def _measure_top_speed(clues: Clues) -> float:
    """Return the highest mean speed of a trial, in mm/s."""
    speeds = [0.0]
    for recording in clues.recordings:
        xs, ys = recording.ticks.x, recording.ticks.y
        distance = sum(math.hypot(b - a, d - c) for a, b, c, d in zip(xs, xs[1:], ys, ys[1:], strict=False))
        speeds.append(float(distance) / recording.end_t if recording.end_t else 0.0)
    return max(speeds)
