"""Judging of printed, said and sent texts: which ones count, how many there are, and their order.

``text_conditions.py`` decides whether one text counts, ``robot_queue.py`` judges the growth of the robot's queue.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from service.grading.findings import ExtraText
from service.grading.grade import TrialResult
from service.grading.judging.agent_pairs import build_pair
from service.grading.judging.channel_losses import is_lost_by_chance
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.robot_queue import collect_queue_lines, is_queued, judge_queue_growth
from service.grading.judging.stray_penalty import Strays, apply_stray_penalty
from service.grading.judging.text_conditions import (
    SOMETHING,
    describe_conditions,
    is_accepted_text,
    is_same_text,
    normalise_text,
)
from sim.recording import Recording, TimedText
from sim.recording_values import get_pose_at
from submissions.criteria.expressions import has_match
from submissions.criteria.texts import Messages, Prints, Says, TextSequence


@dataclass(frozen=True, slots=True)
class TextWording:
    """The wording for a kind of text: the robot, say, said. ``addressed`` texts have a receiver, unlike prints."""

    who: str
    verb: str
    past: str
    addressed: bool = False


#: The beginning of a text that is compared, in characters.
_MAX_COMPARED = 200
_NUMBER = re.compile(r"[-+]?\d[\d.,]*")

_EXCUSED = "Messages lost by chance count as received."
_PRINT = TextWording("the program", "print", "printed")
_RESPONDER_PRINT = TextWording("the responder", "print", "printed")
_SPEECH_WORDING = TextWording("the robot", "say", "said")
_SEND = TextWording("the robot", "send", "sent", addressed=True)
_RECEIVE = TextWording("the robot", "receive", "received")


#: The heading of each cell's output in a notebook's recording.
_CELL_HEADING = re.compile(r"--- cell \d+ ---")


@declare_judge(Prints)
def judge_prints(criterion: Prints, trial: TrialResult) -> Outcome:
    """Judge the program's prints call by call, or the responder's and notebook cells' prints line by line."""
    recording = trial.recording
    if criterion.of == "responder":
        return judge_sequence(criterion, _collect_responder_lines(recording), _RESPONDER_PRINT, recording)
    return judge_sequence(criterion, recording.printed, _PRINT, recording)


def _collect_responder_lines(recording: Recording) -> tuple[TimedText, ...]:
    """Return the lines that the responder printed, with the end as their time, because no times are recorded."""
    texts = recording.responder_output.split("\n") if recording.responder_output else ()
    return tuple(TimedText(recording.end_t, text) for text in texts if not _CELL_HEADING.fullmatch(text))


@declare_judge(Says)
def judge_says(criterion: Says, trial: TrialResult) -> Outcome:
    """Judge what the robot said, in order."""
    return judge_sequence(criterion, trial.recording.spoken, _SPEECH_WORDING, trial.recording)


@declare_judge(Messages)
def judge_messages(criterion: Messages, trial: TrialResult) -> Outcome:
    """Judge what the robot sent, or what its queue received; with ``queue_grows`` also the queue's growth."""
    recording = trial.recording
    if not criterion.queue_grows:
        return _judge_texts(criterion, recording)
    growth_outcome = judge_queue_growth(recording)
    has_count = (criterion.at_least, criterion.at_most, criterion.exactly) != (None, None, None)
    if not (criterion.has_conditions or criterion.in_order or has_count):
        return growth_outcome
    text_outcome = _judge_texts(criterion, recording)
    worse_outcome = text_outcome if growth_outcome.passed else growth_outcome
    return Outcome(
        worse_outcome.passed,
        min(text_outcome.score, growth_outcome.score),
        worse_outcome.message,
        worse_outcome.t,
        worse_outcome.pose,
        findings=worse_outcome.findings,
    )


def judge_sequence(
    criterion: TextSequence, lines: Sequence[TimedText], wording: TextWording, recording: Recording
) -> Outcome:
    """Judge whether the right texts are among ``lines``. Repeated spaces count as one."""
    if criterion.last:
        return _judge_last(criterion, lines, wording, recording)
    accepted_lines = [line for line in lines if is_accepted_text(criterion, line.text)]
    if criterion.in_order:
        outcome, matched_lines = _judge_order(criterion, accepted_lines, lines, wording, recording)
        strays = _find_misplaced_lines(criterion, accepted_lines, matched_lines, wording)
        return apply_stray_penalty(outcome, criterion, len(criterion.in_order), strays)
    outcome = _judge_count(criterion, accepted_lines, lines, wording, recording)
    return apply_stray_penalty(
        outcome,
        criterion,
        max(_find_count_bounds(criterion)[0], 1),
        _find_extra_lines(criterion, lines, accepted_lines, wording),
    )


def _judge_last(
    criterion: TextSequence, lines: Sequence[TimedText], wording: TextWording, recording: Recording
) -> Outcome:
    expected = describe_conditions(criterion)
    if not lines:
        return fail_with(
            f"Expected the last text that {wording.who} {wording.past} to be {expected}, but it {wording.past} nothing."
        )
    last_line = lines[-1]
    pose = get_pose_at(recording, last_line.t)
    if is_accepted_text(criterion, last_line.text):
        return pass_with(
            f"The last text that {wording.who} {wording.past} was {quote_text(last_line.text)}.", last_line.t, pose
        )
    return fail_with(
        f"Expected the last text that {wording.who} {wording.past} to be {expected}, but it was "
        f"{quote_text(last_line.text)}.",
        last_line.t,
        pose,
    )


def _judge_order(
    criterion: TextSequence,
    accepted_lines: Sequence[TimedText],
    lines: Sequence[TimedText],
    wording: TextWording,
    recording: Recording,
) -> tuple[Outcome, Sequence[TimedText]]:
    """Return the outcome, and the lines matched to the texts in order."""
    required_texts = criterion.in_order
    matched_lines: list[TimedText] = []
    extra_line: TimedText | None = None
    for line in accepted_lines:
        if len(matched_lines) < len(required_texts) and _is_distinct_match(
            criterion, line.text, required_texts[len(matched_lines)]
        ):
            matched_lines.append(line)
        elif extra_line is None:
            extra_line = line
    order = " in this order" if len(required_texts) > 1 else ""
    expected = f"Expected {wording.who} to {wording.verb} {quote_list(required_texts)}{order}"
    if criterion.only:
        expected += " and nothing else"
        conditions = describe_conditions(criterion)
        expected += f" that {conditions.removeprefix(SOMETHING)}" if conditions.startswith(SOMETHING) else ""
    extra_count = len(accepted_lines) - len(matched_lines) if criterion.only else 0
    score = Fraction(len(matched_lines), len(required_texts) + extra_count)
    if criterion.only and extra_line is not None:
        message = f"{expected}, but it {wording.past} {quote_text(extra_line.text)} as well."
        extra_pose, findings = get_pose_at(recording, extra_line.t), (ExtraText(extra_line.text),)
        return fail_with(message, extra_line.t, extra_pose, score, findings=findings), matched_lines
    if len(matched_lines) < len(required_texts):
        missing_text = quote_text(required_texts[len(matched_lines)])
        problem = (
            _describe_actual(accepted_lines or lines, wording)
            if not matched_lines
            else f"{missing_text} did not come after {quote_text(matched_lines[-1].text)}"
        )
        time = matched_lines[-1].t if matched_lines else None
        pose = get_pose_at(recording, time) if time is not None else None
        return fail_with(
            f"{expected}, but {problem} ({len(matched_lines)} of {len(required_texts)} found).", time, pose, score
        ), matched_lines
    last_line = matched_lines[-1]
    message = f"{wording.who.capitalize()} {wording.past} {quote_list(required_texts)} in order."
    return pass_with(message, last_line.t, get_pose_at(recording, last_line.t)), matched_lines


def _is_distinct_match(criterion: TextSequence, text: str, expected: str) -> bool:
    """Return whether a text matches the wanted one. A text that contains at least half of the others matches none."""
    if criterion.compare != "contains" or not _is_text_match(criterion, text, expected):
        return _is_text_match(criterion, text, expected)
    other_texts = {other for other in criterion.in_order if not _is_text_match(criterion, expected, other)}
    return not other_texts or 2 * sum(_is_text_match(criterion, text, other) for other in other_texts) < len(
        other_texts
    )


def _find_misplaced_lines(
    criterion: TextSequence,
    accepted_lines: Sequence[TimedText],
    matched_lines: Sequence[TimedText],
    wording: TextWording,
) -> Strays:
    """Return the strays: other lines that count or match a required text, in addition to those found."""
    if criterion.only:
        # Each additional text has already lowered the score.
        return Strays("")
    matched_ids = set(map(id, matched_lines))
    # A loop that repeats one text does not name everything.
    distinct_lines = [
        line for place, line in enumerate(accepted_lines) if not place or line.text != accepted_lines[place - 1].text
    ]
    is_any_counted = criterion.has_conditions or wording.addressed
    misplaced_count = sum(
        is_any_counted or any(_is_text_match(criterion, line.text, text) for text in criterion.in_order)
        for line in distinct_lines
        if id(line) not in matched_ids
    )
    description = f"such texts were {wording.past} {misplaced_count} times at the wrong point"
    # A text that only contains "1" may be about anything.
    is_certain = is_any_counted or criterion.compare == "equals"
    return Strays(description, misplaced=misplaced_count) if is_certain else Strays(description, others=misplaced_count)


def _judge_count(
    criterion: TextSequence,
    accepted_lines: Sequence[TimedText],
    lines: Sequence[TimedText],
    wording: TextWording,
    recording: Recording,
) -> Outcome:
    minimum, maximum = _find_count_bounds(criterion)
    conditions = describe_conditions(criterion) or "something"
    count = len(accepted_lines)
    last_line = accepted_lines[-1] if accepted_lines else None
    time = last_line.t if last_line else None
    pose = get_pose_at(recording, last_line.t) if last_line else None
    if count >= minimum and (maximum is None or count <= maximum):
        if last_line is None:
            return pass_with(f"{wording.who.capitalize()} {wording.past} no forbidden text.")
        count_clause = f" ({count} such texts)" if count > 1 else ""
        return pass_with(
            f"{wording.who.capitalize()} {wording.past} {quote_text(last_line.text)}{count_clause}.", time, pose
        )
    times = _format_times(minimum, maximum)
    expected = f"Expected {wording.who} to {wording.verb} {conditions}{times}"
    if count == 0:
        return fail_with(f"{expected}, but {_describe_actual(lines, wording)}.")
    score = Fraction(count, minimum) if count < minimum else Fraction(maximum or 0, count)
    return fail_with(
        f"{expected}, but it {wording.past} {count} such, the last {quote_text(accepted_lines[-1].text)}.",
        time,
        pose,
        score,
    )


def _find_extra_lines(
    criterion: TextSequence, lines: Sequence[TimedText], accepted_lines: Sequence[TimedText], wording: TextWording
) -> Strays:
    """Return the strays: lines in addition to the required ones.

    Lines that differ only in numbers count once, unless they differ from a required line only in numbers: then each
    counts.
    """
    if not (accepted_lines and criterion.has_conditions and _find_count_bounds(criterion)[0]):
        return Strays("")
    accepted_forms = {_remove_numbers(line.text) for line in accepted_lines}
    accepted_ids = set(map(id, accepted_lines))
    other_forms = [_remove_numbers(line.text) for line in lines if id(line) not in accepted_ids]
    extra_count = sum(form in accepted_forms for form in other_forms) + len(set(other_forms) - accepted_forms)
    return Strays(f"it {wording.past} {extra_count} others as well", others=extra_count)


def _remove_numbers(text: str) -> str:
    """Return a text without its numbers."""
    return _NUMBER.sub("#", " ".join(text[:_MAX_COMPARED].casefold().split()))


def _find_count_bounds(criterion: TextSequence) -> tuple[int, int | None]:
    if criterion.exactly is not None:
        return criterion.exactly, criterion.exactly
    if criterion.at_least is None and criterion.at_most is None:
        return 1, None
    return criterion.at_least or 0, criterion.at_most


def _format_times(minimum: int, maximum: int | None) -> str:
    if maximum is None:
        return "" if minimum == 1 else f" at least {minimum} times"
    if maximum == minimum:
        return " exactly once" if minimum == 1 else f" exactly {minimum} times"
    return f" at most {maximum} times" if minimum == 0 else f" {minimum} to {maximum} times"


def _describe_actual(lines: Sequence[TimedText], wording: TextWording) -> str:
    if not lines:
        return f"it {wording.past} nothing"
    if len(lines) == 1:
        return f"it {wording.past} {quote_text(lines[0].text)}"
    return f"it {wording.past} {len(lines)} other texts, the last {quote_text(lines[-1].text)}"


def _judge_texts(criterion: Messages, recording: Recording) -> Outcome:
    if not criterion.json_queue:
        pair = build_pair(criterion, recording)
        sent_texts = [
            TimedText(message.t, message.text) for message in pair.recording.messages if message.sender == "robot"
        ]
        wording = (
            TextWording(pair.sender_name, f"tell {pair.receiver_name}", f"told {pair.receiver_name}")
            if criterion.agents
            else _SEND
        )
        return judge_sequence(criterion, sent_texts, wording, recording)
    arrived_messages = [message for message in recording.messages if is_queued(message)]
    arrived_texts = [(message.delivered or 0.0, message.received) for message in arrived_messages]
    outcome = judge_sequence(criterion, collect_queue_lines(criterion, arrived_texts), _RECEIVE, recording)
    lost_answers = [
        message for message in recording.messages if message.sender == "responder" and is_lost_by_chance(message)
    ]
    if outcome.passed or not lost_answers:
        return outcome
    # Judge the answers as if there were no random losses, because the program cannot prevent them.
    answered_texts = {
        id(message): (message.delivered or message.t, message.text) for message in (*arrived_messages, *lost_answers)
    }
    excused_outcome = judge_sequence(
        criterion, collect_queue_lines(criterion, answered_texts.values()), _RECEIVE, recording
    )
    if excused_outcome.score <= outcome.score:
        return outcome
    return replace(excused_outcome, message=f"{excused_outcome.message} {_EXCUSED}")


def _is_text_match(criterion: TextSequence, text: str, expected: str) -> bool:
    fold = criterion.ignore_case
    match criterion.compare:
        case "equals":
            return is_same_text(text, expected, fold)
        case "contains":
            return normalise_text(expected, fold) in normalise_text(text, fold)
        case "starts_with":
            return normalise_text(text, fold).startswith(normalise_text(expected, fold))
        case "matches":
            return has_match(text, expected, fold)
