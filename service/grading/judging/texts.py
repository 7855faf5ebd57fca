"""Judging of printed, said and sent texts: which ones count, how many there are, and their order.

The texts come from students, the patterns from instructors. Matching takes time linear in the length of the text.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from responders.message_format import JSON, PY
from service.grading.grade import TrialResult
from service.grading.judging.agent_pairs import build_pair
from service.grading.judging.answers import MISSING, Answers, as_text, find_at_path, is_json_answer, parse_json_answer
from service.grading.judging.channel_losses import describe_loss, is_lost_by_chance, is_out_of_reach
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.message_parts import quote_list, quote_text
from service.grading.judging.outcome import Outcome, fail_with, pass_with
from service.grading.judging.stray_penalty import Strays, apply_stray_penalty
from service.grading.judging.text_tokens import find_words, split_words
from sim.recording import Message, Recording, TimedText
from sim.recording_values import get_pose_at
from submissions.criteria.expressions import has_match
from submissions.criteria.texts import Messages, Prints, Says, TextConditions, TextSequence


@dataclass(frozen=True, slots=True)
class TextWording:
    """The wording for a kind of text: the robot, say, said. ``addressed`` texts have a receiver, unlike prints."""

    who: str
    verb: str
    past: str
    addressed: bool = False


#: The beginning of conditions that are more than quoted texts.
_SOMETHING = "something that "
#: The beginning of a text that is compared, in characters.
_MAX_COMPARED = 200
_NUMBER = re.compile(r"[-+]?\d[\d.,]*")

_EXCUSED = "Messages lost by chance count as received."
_PRINT = TextWording("the program", "print", "printed")
_RESPONDER_PRINT = TextWording("the responder", "print", "printed")
_SAY = TextWording("the robot", "say", "said")
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
    return judge_sequence(criterion, trial.recording.spoken, _SAY, trial.recording)


@declare_judge(Messages)
def judge_messages(criterion: Messages, trial: TrialResult) -> Outcome:
    """Judge what the robot sent, or what its queue received; with ``queue_grows`` also the queue's growth."""
    recording = trial.recording
    if not criterion.queue_grows:
        return _judge_texts(criterion, recording)
    grown = _judge_queue_growth(recording)
    counted = (criterion.at_least, criterion.at_most, criterion.exactly) != (None, None, None)
    if not (criterion.has_conditions or criterion.in_order or counted):
        return grown
    texts = _judge_texts(criterion, recording)
    worse = texts if grown.passed else grown
    return Outcome(worse.passed, min(texts.score, grown.score), worse.message, worse.t, worse.pose)


def judge_sequence(
    criterion: TextSequence, lines: Sequence[TimedText], deed: TextWording, recording: Recording
) -> Outcome:
    """Judge whether the right texts are among ``lines``. Repeated spaces count as one."""
    if criterion.last:
        return _judge_last(criterion, lines, deed, recording)
    chosen = [line for line in lines if is_accepted_text(criterion, line.text)]
    if criterion.in_order:
        outcome, found = _judge_order(criterion, chosen, lines, deed, recording)
        beside = _find_misplaced_lines(criterion, chosen, found, deed)
        return apply_stray_penalty(outcome, criterion, len(criterion.in_order), beside)
    outcome = _judge_count(criterion, chosen, lines, deed, recording)
    return apply_stray_penalty(
        outcome, criterion, max(_find_count_bounds(criterion)[0], 1), _find_extra_lines(criterion, lines, chosen, deed)
    )


def is_accepted_text(criterion: TextConditions, text: str) -> bool:
    """Return whether a text meets all given conditions."""
    fold = criterion.ignore_case
    plain = _normalise_text(text, fold)
    if criterion.equals and plain not in [_normalise_text(wanted, fold) for wanted in criterion.equals]:
        return False
    if criterion.starts_with and not plain.startswith(tuple(_normalise_text(w, fold) for w in criterion.starts_with)):
        return False
    if not all(_normalise_text(wanted, fold) in plain for wanted in criterion.contains):
        return False
    if criterion.among and len(_find_named_choices(criterion.among, text)) != 1:
        return False
    return criterion.matches is None or has_match(text, criterion.matches, fold)


def describe_conditions(criterion: TextConditions) -> str:
    """Return the conditions in words: ``"x" or "y"``, ``something that contains "x"``; empty without conditions."""
    others = criterion.starts_with or criterion.contains or criterion.among or criterion.matches is not None
    if criterion.equals and not others:
        return quote_list(criterion.equals, "or")
    words = []
    if criterion.equals:
        words.append(f"is {quote_list(criterion.equals, 'or')}")
    if criterion.starts_with:
        words.append(f"starts with {quote_list(criterion.starts_with, 'or')}")
    if criterion.contains:
        words.append(f"contains {quote_list(criterion.contains)}")
    if criterion.among:
        words.append(f"names only one of {quote_list(criterion.among)}")
    if criterion.matches is not None:
        words.append(f"matches the pattern {quote_text(criterion.matches)}")
    return f"{_SOMETHING}{' and '.join(words)}" if words else ""


def is_same_text(text: str, wanted: str, ignore_case: bool) -> bool:
    """Return whether two texts are equal apart from blanks at the ends, repeated blanks and, if requested, case."""
    return _normalise_text(text, ignore_case) == _normalise_text(wanted, ignore_case)


def _judge_last(
    criterion: TextSequence, lines: Sequence[TimedText], deed: TextWording, recording: Recording
) -> Outcome:
    wanted = describe_conditions(criterion)
    if not lines:
        return fail_with(
            f"Expected the last text that {deed.who} {deed.past} to be {wanted}, but it {deed.past} nothing."
        )
    last = lines[-1]
    pose = get_pose_at(recording, last.t)
    if is_accepted_text(criterion, last.text):
        return pass_with(f"The last text that {deed.who} {deed.past} was {quote_text(last.text)}.", last.t, pose)
    return fail_with(
        f"Expected the last text that {deed.who} {deed.past} to be {wanted}, but it was {quote_text(last.text)}.",
        last.t,
        pose,
    )


def _judge_order(
    criterion: TextSequence,
    chosen: Sequence[TimedText],
    lines: Sequence[TimedText],
    deed: TextWording,
    recording: Recording,
) -> tuple[Outcome, Sequence[TimedText]]:
    """Return the outcome, and the lines matched to the texts in order."""
    wanted = criterion.in_order
    found: list[TimedText] = []
    extra: TimedText | None = None
    for line in chosen:
        if len(found) < len(wanted) and _is_distinct_match(criterion, line.text, wanted[len(found)]):
            found.append(line)
        elif extra is None:
            extra = line
    expected = f"Expected {deed.who} to {deed.verb} {quote_list(wanted)}{' in this order' if len(wanted) > 1 else ''}"
    if criterion.only:
        expected += " and nothing else"
        counts = describe_conditions(criterion)
        expected += f" that {counts.removeprefix(_SOMETHING)}" if counts.startswith(_SOMETHING) else ""
    extras = len(chosen) - len(found) if criterion.only else 0
    score = Fraction(len(found), len(wanted) + extras)
    if criterion.only and extra is not None:
        words = f"{expected}, but it {deed.past} {quote_text(extra.text)} as well."
        return fail_with(words, extra.t, get_pose_at(recording, extra.t), score), found
    if len(found) < len(wanted):
        missing = quote_text(wanted[len(found)])
        what = (
            _describe_actual(chosen or lines, deed)
            if not found
            else f"{missing} did not come after {quote_text(found[-1].text)}"
        )
        at = found[-1].t if found else None
        pose = get_pose_at(recording, at) if at is not None else None
        return fail_with(f"{expected}, but {what} ({len(found)} of {len(wanted)} found).", at, pose, score), found
    end = found[-1]
    words = f"{deed.who.capitalize()} {deed.past} {quote_list(wanted)} in order."
    return pass_with(words, end.t, get_pose_at(recording, end.t)), found


def _is_distinct_match(criterion: TextSequence, text: str, wanted: str) -> bool:
    """Return whether a text matches the wanted one. A text that contains at least half of the others matches none."""
    if criterion.compare != "contains" or not _is_text_match(criterion, text, wanted):
        return _is_text_match(criterion, text, wanted)
    others = {other for other in criterion.in_order if not _is_text_match(criterion, wanted, other)}
    return not others or 2 * sum(_is_text_match(criterion, text, other) for other in others) < len(others)


def _find_misplaced_lines(
    criterion: TextSequence, chosen: Sequence[TimedText], found: Sequence[TimedText], deed: TextWording
) -> Strays:
    """Return the strays: other lines that count or match a required text, in addition to those found."""
    if criterion.only:
        # Each additional text has already lowered the score.
        return Strays("")
    taken = set(map(id, found))
    # A loop that repeats one text does not name everything.
    changed = [line for place, line in enumerate(chosen) if not place or line.text != chosen[place - 1].text]
    every = criterion.has_conditions or deed.addressed
    extra = sum(
        every or any(_is_text_match(criterion, line.text, text) for text in criterion.in_order)
        for line in changed
        if id(line) not in taken
    )
    words = f"such texts were {deed.past} {extra} times at the wrong point"
    # A text that only contains "1" may be about anything.
    sure = every or criterion.compare == "equals"
    return Strays(words, misplaced=extra) if sure else Strays(words, others=extra)


def _judge_count(
    criterion: TextSequence,
    chosen: Sequence[TimedText],
    lines: Sequence[TimedText],
    deed: TextWording,
    recording: Recording,
) -> Outcome:
    least, most = _find_count_bounds(criterion)
    what = describe_conditions(criterion) or "something"
    count = len(chosen)
    last = chosen[-1] if chosen else None
    at = last.t if last else None
    pose = get_pose_at(recording, last.t) if last else None
    if count >= least and (most is None or count <= most):
        if last is None:
            return pass_with(f"{deed.who.capitalize()} {deed.past} no forbidden text.")
        again = f" ({count} such texts)" if count > 1 else ""
        return pass_with(f"{deed.who.capitalize()} {deed.past} {quote_text(last.text)}{again}.", at, pose)
    times = _format_times(least, most)
    expected = f"Expected {deed.who} to {deed.verb} {what}{times}"
    if count == 0:
        return fail_with(f"{expected}, but {_describe_actual(lines, deed)}.")
    score = Fraction(count, least) if count < least else Fraction(most or 0, count)
    return fail_with(
        f"{expected}, but it {deed.past} {count} such, the last {quote_text(chosen[-1].text)}.", at, pose, score
    )


def _find_extra_lines(
    criterion: TextSequence, lines: Sequence[TimedText], chosen: Sequence[TimedText], deed: TextWording
) -> Strays:
    """Return the strays: lines in addition to the required ones.

    Lines that differ only in numbers count once, unless they differ from a required line only in numbers: then each
    counts.
    """
    if not (chosen and criterion.has_conditions and _find_count_bounds(criterion)[0]):
        return Strays("")
    guessed = {_remove_numbers(line.text) for line in chosen}
    counted = set(map(id, chosen))
    forms = [_remove_numbers(line.text) for line in lines if id(line) not in counted]
    others = sum(form in guessed for form in forms) + len(set(forms) - guessed)
    return Strays(f"it {deed.past} {others} others as well", others=others)


def _remove_numbers(text: str) -> str:
    """Return a text without its numbers."""
    return _NUMBER.sub("#", " ".join(text[:_MAX_COMPARED].casefold().split()))


def _find_count_bounds(criterion: TextSequence) -> tuple[int, int | None]:
    if criterion.exactly is not None:
        return criterion.exactly, criterion.exactly
    if criterion.at_least is None and criterion.at_most is None:
        return 1, None
    return criterion.at_least or 0, criterion.at_most


def _format_times(least: int, most: int | None) -> str:
    if most is None:
        return "" if least == 1 else f" at least {least} times"
    if most == least:
        return " exactly once" if least == 1 else f" exactly {least} times"
    return f" at most {most} times" if least == 0 else f" {least} to {most} times"


def _describe_actual(lines: Sequence[TimedText], deed: TextWording) -> str:
    if not lines:
        return f"it {deed.past} nothing"
    if len(lines) == 1:
        return f"it {deed.past} {quote_text(lines[0].text)}"
    return f"it {deed.past} {len(lines)} other texts, the last {quote_text(lines[-1].text)}"


def _judge_texts(criterion: Messages, recording: Recording) -> Outcome:
    if not criterion.json_queue:
        pair = build_pair(criterion, recording)
        sent = [TimedText(message.t, message.text) for message in pair.recording.messages if message.sender == "robot"]
        deed = (
            TextWording(pair.sender_name, f"tell {pair.receiver_name}", f"told {pair.receiver_name}")
            if criterion.agents
            else _SEND
        )
        return judge_sequence(criterion, sent, deed, recording)
    arrived = [message for message in recording.messages if _is_queued(message)]
    as_arrived = [(message.delivered or 0.0, message.received) for message in arrived]
    outcome = judge_sequence(criterion, _collect_queue_lines(criterion, as_arrived), _RECEIVE, recording)
    astray = [message for message in recording.messages if message.sender == "responder" and is_lost_by_chance(message)]
    if outcome.passed or not astray:
        return outcome
    # Judge the answers as if there were no random losses, because the program cannot prevent them.
    as_answered = {id(message): (message.delivered or message.t, message.text) for message in (*arrived, *astray)}
    excused = judge_sequence(criterion, _collect_queue_lines(criterion, as_answered.values()), _RECEIVE, recording)
    if excused.score <= outcome.score:
        return outcome
    return replace(excused, message=f"{excused.message} {_EXCUSED}")


def _collect_queue_lines(criterion: Messages, answers: Iterable[tuple[float, str]]) -> list[TimedText]:
    """Return the answers that join the robot's queue, in order of time, reduced to the requested value."""
    lines = []
    for t, text in sorted(answers, key=lambda answer: answer[0]):
        value = parse_json_answer(text)
        value = value if value is MISSING or criterion.path is None else find_at_path(value, criterion.path)
        if value is not MISSING:
            lines.append(TimedText(t, as_text(value)))
    return lines


def _is_queued(message: Message) -> bool:
    """Return whether it is an answer that joined the robot's queue."""
    if message.sender != "responder" or message.delivered is None:
        return False
    if message.arrived_as is not None:
        return is_json_answer(message.arrived_as)
    return message.text.startswith(JSON) and message.note != "malformed"


def _judge_queue_growth(recording: Recording) -> Outcome:
    """Judge whether every PY:: message that reached the responder has its JSON:: answer in the queue, in order.

    Answers that the channel lost by chance, or that came when the message was sent again, are not missed.
    """
    sent = [
        (index, message)
        for index, message in enumerate(recording.messages)
        if message.sender == "robot" and message.text.startswith(PY)
    ]
    asked = [(index, message) for index, message in sent if message.delivered is not None]
    expected = "Expected the robot's queue to grow by one JSON:: message for each PY:: message"
    if not asked:
        astray = next((message for _, message in sent if is_out_of_reach(message)), None)
        if sent and not astray:
            return pass_with("The channel lost every PY:: message by chance, so there were no answers to queue.")
        lost = f"the channel lost {quote_text(astray.text)} ({describe_loss(astray)})" if astray else ""
        return fail_with(f"{expected}, but {lost or 'the robot sent no PY:: message'}.")
    answers = Answers(recording)
    replies = [(message, _find_reply(answers, index)) for index, message in asked]
    arrivals = [reply.delivered for _, reply in replies if reply is not None and _is_queued(reply)]
    came = {message.text for message, reply in replies if reply is not None and _is_queued(reply)}
    # A repeated message shows nothing new.
    different = {message.text for _, message in asked}
    missed = [(message, reply) for message, reply in replies if not _is_excused(message, reply, came)]
    score = Fraction(len(different - {message.text for message, _ in missed}), len(different))
    for message, reply in missed:
        happened = "got no answer" if reply is None else f"was answered with {quote_text(reply.text)}"
        if reply is not None and reply.delivered is None and reply.note == "undelivered":
            happened = "got its answer only after the program had ended"
        if reply is not None and is_out_of_reach(reply):
            happened = f"was answered and the channel lost the answer ({describe_loss(reply)})"
        return fail_with(
            f"{expected}, but {quote_text(message.text)} {happened} ({len(arrivals)} of {len(asked)} in the queue).",
            message.t,
            get_pose_at(recording, message.t),
            score,
        )
    if not arrivals:
        return pass_with("The channel lost every answer by chance.")
    times = [arrived or 0.0 for arrived in arrivals]
    if times != sorted(times):
        return fail_with(f"{expected}, but the answers arrived in another order.", times[-1], None, score)
    return pass_with(
        f"The robot's queue grew by one for each of {len(arrivals)} messages.",
        times[-1],
        get_pose_at(recording, times[-1]),
    )


def _find_reply(answers: Answers, index: int) -> Message | None:
    """Return the answer that joined the queue, the first of several copies; otherwise the first answer."""
    return next(filter(_is_queued, answers.list_answers(index)), answers.find_answer(index))


def _is_excused(message: Message, reply: Message | None, came: Container[str]) -> bool:
    """Return whether a message's answer is in the queue, or missing only because of the channel."""
    if reply is None:
        return False
    return _is_queued(reply) or is_lost_by_chance(reply) or (is_out_of_reach(reply) and message.text in came)


def _is_text_match(criterion: TextSequence, text: str, wanted: str) -> bool:
    fold = criterion.ignore_case
    match criterion.compare:
        case "equals":
            return is_same_text(text, wanted, fold)
        case "contains":
            return _normalise_text(wanted, fold) in _normalise_text(text, fold)
        case "starts_with":
            return _normalise_text(text, fold).startswith(_normalise_text(wanted, fold))
        case "matches":
            return has_match(text, wanted, fold)


def _find_named_choices(choices: Sequence[str], text: str) -> list[str]:
    """Return the choices that a text contains as whole words."""
    words = split_words(text)
    return [choice for choice in choices if find_words(words, split_words(choice)) is not None]


def _normalise_text(text: str, ignore_case: bool) -> str:
    plain = " ".join(text.split())
    return plain.casefold() if ignore_case else plain
