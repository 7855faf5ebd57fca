"""Judging of printed, said and sent texts: which ones count, how many there are, and their order.

``text_conditions.py`` decides whether one text counts, ``robot_queue.py`` judges the growth of the robot's queue.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from service.grading.findings import ExtraText
from service.grading.grade import TrialResult
from service.grading.judging.answers import build_pair
from service.grading.judging.channel_losses import is_lost_by_chance
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, Strays, apply_stray_penalty, fail_with, pass_with
from service.grading.judging.robot_queue import collect_queue_lines, is_queued, judge_queue_growth
from service.grading.judging.text_conditions import (
    PRINT,
    RECEIVED_TEXT,
    RESPONDER_PRINT,
    SENT_TEXT,
    SPEECH,
    TextWording,
    build_agent_wording,
    describe_clauses,
    describe_conditions,
    is_accepted_text,
    is_same_text,
    normalise_text,
)
from sim.recording import Recording, TimedText
from sim.recording_values import get_pose_at
from sim.sentences import Sentence, join_sentences
from submissions.criteria.expressions import has_match
from submissions.criteria.texts import Messages, Prints, Says, TextSequence

#: The beginning of a text that is compared, in characters.
_MAX_COMPARED = 200
_NUMBER = re.compile(r"[-+]?\d[\d.,]*")

_EXCUSED = Sentence("Messages lost by chance count as received.")
_NOTHING = Sentence("nothing")

#: The heading of each cell's output in a notebook's recording.
_CELL_HEADING = re.compile(r"--- cell \d+ ---")


@declare_judge(Prints)
def judge_prints(criterion: Prints, trial: TrialResult) -> Outcome:
    """Judge the program's prints call by call, or the responder's and notebook cells' prints line by line."""
    recording = trial.recording
    if criterion.of == "responder":
        return judge_sequence(criterion, _collect_responder_lines(recording), RESPONDER_PRINT, recording)
    return judge_sequence(criterion, recording.printed, PRINT, recording)


def _collect_responder_lines(recording: Recording) -> tuple[TimedText, ...]:
    """Return the lines that the responder printed, with the end as their time, because no times are recorded."""
    texts = recording.responder_output.split("\n") if recording.responder_output else ()
    return tuple(TimedText(recording.end_t, text) for text in texts if not _CELL_HEADING.fullmatch(text))


@declare_judge(Says)
def judge_says(criterion: Says, trial: TrialResult) -> Outcome:
    """Judge what the robot said, in order."""
    return judge_sequence(criterion, trial.recording.spoken, SPEECH, trial.recording)


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
    last_line = lines[-1] if lines else None
    if last_line is None:
        return fail_with(_describe_wrong_last(criterion, wording, wording.describe_actual(_NOTHING)))
    last_text, pose = quote_text(last_line.text), get_pose_at(recording, last_line.t)
    if is_accepted_text(criterion, last_line.text):
        message = Sentence("The %(last_text)s was %(text)s.", last_text=wording.describe_last(), text=last_text)
        return pass_with(message, last_line.t, pose)
    actual = Sentence("it was %(text)s", text=last_text)
    return fail_with(_describe_wrong_last(criterion, wording, actual), last_line.t, pose)


def _describe_wrong_last(criterion: TextSequence, wording: TextWording, actual: str) -> str:
    return Sentence(
        "Expected the %(last_text)s to be %(expected)s, but %(actual)s.",
        last_text=wording.describe_last(),
        expected=describe_conditions(criterion),
        actual=actual,
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
    expected = wording.describe_expected(_describe_required(criterion))
    extra_count = len(accepted_lines) - len(matched_lines) if criterion.only else 0
    score = Fraction(len(matched_lines), len(required_texts) + extra_count)
    if criterion.only and extra_line is not None:
        extra_text = Sentence("%(text)s as well", text=quote_text(extra_line.text))
        actual = wording.describe_actual(extra_text)
        message = Sentence("%(expected)s, but %(actual)s.", expected=expected, actual=actual)
        extra_pose, findings = get_pose_at(recording, extra_line.t), (ExtraText(extra_line.text),)
        return fail_with(message, extra_line.t, extra_pose, score, findings=findings), matched_lines
    if len(matched_lines) < len(required_texts):
        message = Sentence(
            "%(expected)s, but %(actual)s (%(count)s of %(total)s found).",
            expected=expected,
            actual=_describe_actual(accepted_lines or lines, wording)
            if not matched_lines
            else Sentence(
                "%(text)s did not come after %(previous)s",
                text=quote_text(required_texts[len(matched_lines)]),
                previous=quote_text(matched_lines[-1].text),
            ),
            count=len(matched_lines),
            total=len(required_texts),
        )
        time = matched_lines[-1].t if matched_lines else None
        pose = get_pose_at(recording, time) if time is not None else None
        return fail_with(message, time, pose, score), matched_lines
    last_line = matched_lines[-1]
    passed_text = wording.describe_passed(Sentence("%(texts)s in order", texts=quote_list(required_texts)))
    return pass_with(passed_text, last_line.t, get_pose_at(recording, last_line.t)), matched_lines


def _describe_required(criterion: TextSequence) -> str:
    """Return the required texts in order, as a phrase."""
    texts = quote_list(criterion.in_order)
    if len(criterion.in_order) > 1:
        texts = Sentence("%(texts)s in this order", texts=texts)
    if not criterion.only:
        return texts
    clauses = describe_clauses(criterion)
    if not clauses:
        return Sentence("%(texts)s and nothing else", texts=texts)
    return Sentence("%(texts)s and nothing else that %(clauses)s", texts=texts, clauses=clauses)


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
    description = wording.describe_misplaced(misplaced_count)
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
    count = len(accepted_lines)
    last_line = accepted_lines[-1] if accepted_lines else None
    time = last_line.t if last_line else None
    pose = get_pose_at(recording, last_line.t) if last_line else None
    if count >= minimum and (maximum is None or count <= maximum):
        if last_line is None:
            return pass_with(wording.describe_passed(Sentence("no forbidden text")))
        texts = quote_text(last_line.text)
        if count > 1:
            texts = Sentence("%(text)s (%(count)s such texts)", text=texts, count=count)
        return pass_with(wording.describe_passed(texts), time, pose)
    if last_line is None:
        actual = _describe_actual(lines, wording)
    else:
        last_text = quote_text(last_line.text)
        actual = wording.describe_actual(Sentence("%(count)s such, the last %(text)s", count=count, text=last_text))
    conditions = describe_conditions(criterion) or Sentence("something")
    expected = wording.describe_expected(_add_times(conditions, minimum, maximum))
    score = Fraction(count, minimum) if count < minimum else Fraction(maximum or 0, count)
    message = Sentence("%(expected)s, but %(actual)s.", expected=expected, actual=actual)
    return fail_with(message, time, pose, score)


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
    extras = Sentence("%(count)s others as well", count=extra_count)
    return Strays(wording.describe_actual(extras), others=extra_count)


def _remove_numbers(text: str) -> str:
    """Return a text without its numbers."""
    return _NUMBER.sub("#", " ".join(text[:_MAX_COMPARED].casefold().split()))


def _find_count_bounds(criterion: TextSequence) -> tuple[int, int | None]:
    if criterion.exactly is not None:
        return criterion.exactly, criterion.exactly
    if criterion.at_least is None and criterion.at_most is None:
        return 1, None
    return criterion.at_least or 0, criterion.at_most


def _add_times(texts: str, minimum: int, maximum: int | None) -> str:
    """Return a phrase for texts with how often they are required."""
    if maximum is None:
        return texts if minimum == 1 else Sentence("%(texts)s at least %(count)s times", texts=texts, count=minimum)
    if maximum == minimum == 1:
        return Sentence("%(texts)s exactly once", texts=texts)
    if maximum == minimum:
        return Sentence("%(texts)s exactly %(count)s times", texts=texts, count=minimum)
    if minimum == 0:
        return Sentence("%(texts)s at most %(count)s times", texts=texts, count=maximum)
    return Sentence("%(texts)s %(least)s to %(most)s times", texts=texts, least=minimum, most=maximum)


def _describe_actual(lines: Sequence[TimedText], wording: TextWording) -> str:
    if not lines:
        return wording.describe_actual(_NOTHING)
    last_text = quote_text(lines[-1].text)
    if len(lines) == 1:
        return wording.describe_actual(last_text)
    other_texts = Sentence("%(count)s other texts, the last %(text)s", count=len(lines), text=last_text)
    return wording.describe_actual(other_texts)


def _judge_texts(criterion: Messages, recording: Recording) -> Outcome:
    if not criterion.json_queue:
        pair = build_pair(criterion, recording)
        sent_texts = [
            TimedText(message.t, message.text) for message in pair.recording.messages if message.sender == "robot"
        ]
        wording = build_agent_wording(*criterion.agents) if criterion.agents else SENT_TEXT
        return judge_sequence(criterion, sent_texts, wording, recording)
    arrived_messages = [message for message in recording.messages if is_queued(message)]
    arrived_texts = [(message.delivered or 0.0, message.received) for message in arrived_messages]
    outcome = judge_sequence(criterion, collect_queue_lines(criterion, arrived_texts), RECEIVED_TEXT, recording)
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
        criterion, collect_queue_lines(criterion, answered_texts.values()), RECEIVED_TEXT, recording
    )
    if excused_outcome.score <= outcome.score:
        return outcome
    return replace(excused_outcome, message=join_sentences(excused_outcome.message, _EXCUSED))


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
