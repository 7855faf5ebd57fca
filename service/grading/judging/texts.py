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
from service.grading.judging.answers import NOTHING, Answers, as_text, at_path, is_json_answer, parsed
from service.grading.judging.asking import pair_of
from service.grading.judging.judges import judges
from service.grading.judging.losses import by_chance, loss_words, out_of_reach
from service.grading.judging.message_parts import listed, quoted
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.precision import Strays, tempered
from service.grading.judging.text_tokens import find_words, words_of
from sim.recorded import pose_at
from sim.recording import Line, Message, Recording
from submissions.criteria.expressions import found_in
from submissions.criteria.texts import Messages, Prints, Says, TextConditions, TextSequence


@dataclass(frozen=True, slots=True)
class Deed:
    """The wording for a kind of text: the robot, say, said. ``addressed`` texts have a receiver, unlike prints."""

    who: str
    verb: str
    past: str
    addressed: bool = False


#: The beginning of conditions that are more than quoted texts.
_SOMETHING = "something that "
#: The beginning of a text that is compared, in characters.
_LONG = 200
_NUMBER = re.compile(r"[-+]?\d[\d.,]*")

_EXCUSED = "Messages lost by chance count as received."
_PRINT = Deed("the program", "print", "printed")
_RESPONDER_PRINT = Deed("the responder", "print", "printed")
_SAY = Deed("the robot", "say", "said")
_SEND = Deed("the robot", "send", "sent", addressed=True)
_RECEIVE = Deed("the robot", "receive", "received")


#: The heading of each cell's output in a notebook's recording.
_CELL_HEADING = re.compile(r"--- cell \d+ ---")


@judges(Prints)
def judge_prints(criterion: Prints, trial: TrialResult) -> Outcome:
    """Judge the program's prints call by call, or the responder's and notebook cells' prints line by line."""
    recording = trial.recording
    if criterion.of == "responder":
        return judge_sequence(criterion, _responder_lines(recording), _RESPONDER_PRINT, recording)
    return judge_sequence(criterion, recording.printed, _PRINT, recording)


def _responder_lines(recording: Recording) -> tuple[Line, ...]:
    """Return the lines that the responder printed, with the end as their time, because no times are recorded."""
    texts = recording.responder_output.split("\n") if recording.responder_output else ()
    return tuple(Line(recording.end_t, text) for text in texts if not _CELL_HEADING.fullmatch(text))


@judges(Says)
def judge_says(criterion: Says, trial: TrialResult) -> Outcome:
    """Judge what the robot said, in order."""
    return judge_sequence(criterion, trial.recording.spoken, _SAY, trial.recording)


@judges(Messages)
def judge_messages(criterion: Messages, trial: TrialResult) -> Outcome:
    """Judge what the robot sent, or what its queue received; with ``queue_grows`` also the queue's growth."""
    recording = trial.recording
    if not criterion.queue_grows:
        return _judge_texts(criterion, recording)
    grown = _queue_grows(recording)
    counted = (criterion.at_least, criterion.at_most, criterion.exactly) != (None, None, None)
    if not (criterion.has_conditions or criterion.in_order or counted):
        return grown
    texts = _judge_texts(criterion, recording)
    worse = texts if grown.passed else grown
    return Outcome(worse.passed, min(texts.score, grown.score), worse.message, worse.t, worse.pose)


def judge_sequence(criterion: TextSequence, lines: Sequence[Line], deed: Deed, recording: Recording) -> Outcome:
    """Judge whether the right texts are among ``lines``. Repeated spaces count as one."""
    if criterion.last:
        return _judge_last(criterion, lines, deed, recording)
    chosen = [line for line in lines if meets(criterion, line.text)]
    if criterion.in_order:
        outcome, found = _judge_order(criterion, chosen, lines, deed, recording)
        beside = _out_of_order(criterion, chosen, found, deed)
        return tempered(outcome, criterion, len(criterion.in_order), beside)
    outcome = _judge_count(criterion, chosen, lines, deed, recording)
    return tempered(outcome, criterion, max(_bounds(criterion)[0], 1), _beside(criterion, lines, chosen, deed))


def meets(criterion: TextConditions, text: str) -> bool:
    """Return whether a text meets all given conditions."""
    fold = criterion.ignore_case
    plain = _plain(text, fold)
    if criterion.equals and plain not in [_plain(wanted, fold) for wanted in criterion.equals]:
        return False
    if criterion.starts_with and not plain.startswith(tuple(_plain(w, fold) for w in criterion.starts_with)):
        return False
    if not all(_plain(wanted, fold) in plain for wanted in criterion.contains):
        return False
    if criterion.among and len(_named(criterion.among, text)) != 1:
        return False
    return criterion.matches is None or found_in(text, criterion.matches, fold)


def conditions(criterion: TextConditions) -> str:
    """Return the conditions in words: ``"x" or "y"``, ``something that contains "x"``; empty without conditions."""
    others = criterion.starts_with or criterion.contains or criterion.among or criterion.matches is not None
    if criterion.equals and not others:
        return listed(criterion.equals, "or")
    words = []
    if criterion.equals:
        words.append(f"is {listed(criterion.equals, 'or')}")
    if criterion.starts_with:
        words.append(f"starts with {listed(criterion.starts_with, 'or')}")
    if criterion.contains:
        words.append(f"contains {listed(criterion.contains)}")
    if criterion.among:
        words.append(f"names only one of {listed(criterion.among)}")
    if criterion.matches is not None:
        words.append(f"matches the pattern {quoted(criterion.matches)}")
    return f"{_SOMETHING}{' and '.join(words)}" if words else ""


def same_text(text: str, wanted: str, ignore_case: bool) -> bool:
    """Return whether two texts are equal apart from blanks at the ends, repeated blanks and, if requested, case."""
    return _plain(text, ignore_case) == _plain(wanted, ignore_case)


def _judge_last(criterion: TextSequence, lines: Sequence[Line], deed: Deed, recording: Recording) -> Outcome:
    wanted = conditions(criterion)
    if not lines:
        return failed(f"Expected the last text that {deed.who} {deed.past} to be {wanted}, but it {deed.past} nothing.")
    last = lines[-1]
    pose = pose_at(recording, last.t)
    if meets(criterion, last.text):
        return passed(f"The last text that {deed.who} {deed.past} was {quoted(last.text)}.", last.t, pose)
    return failed(
        f"Expected the last text that {deed.who} {deed.past} to be {wanted}, but it was {quoted(last.text)}.",
        last.t,
        pose,
    )


def _judge_order(
    criterion: TextSequence, chosen: Sequence[Line], lines: Sequence[Line], deed: Deed, recording: Recording
) -> tuple[Outcome, Sequence[Line]]:
    """Return the outcome, and the lines matched to the texts in order."""
    wanted = criterion.in_order
    found: list[Line] = []
    extra: Line | None = None
    for line in chosen:
        if len(found) < len(wanted) and _stands_for(criterion, line.text, wanted[len(found)]):
            found.append(line)
        elif extra is None:
            extra = line
    expected = f"Expected {deed.who} to {deed.verb} {listed(wanted)}{' in this order' if len(wanted) > 1 else ''}"
    if criterion.only:
        expected += " and nothing else"
        counts = conditions(criterion)
        expected += f" that {counts.removeprefix(_SOMETHING)}" if counts.startswith(_SOMETHING) else ""
    extras = len(chosen) - len(found) if criterion.only else 0
    score = Fraction(len(found), len(wanted) + extras)
    if criterion.only and extra is not None:
        words = f"{expected}, but it {deed.past} {quoted(extra.text)} as well."
        return failed(words, extra.t, pose_at(recording, extra.t), score), found
    if len(found) < len(wanted):
        missing = quoted(wanted[len(found)])
        what = (
            _instead(chosen or lines, deed) if not found else f"{missing} did not come after {quoted(found[-1].text)}"
        )
        at = found[-1].t if found else None
        pose = pose_at(recording, at) if at is not None else None
        return failed(f"{expected}, but {what} ({len(found)} of {len(wanted)} found).", at, pose, score), found
    end = found[-1]
    words = f"{deed.who.capitalize()} {deed.past} {listed(wanted)} in order."
    return passed(words, end.t, pose_at(recording, end.t)), found


def _stands_for(criterion: TextSequence, text: str, wanted: str) -> bool:
    """Return whether a text matches the wanted one. A text that contains at least half of the others matches none."""
    if criterion.compare != "contains" or not _compares(criterion, text, wanted):
        return _compares(criterion, text, wanted)
    others = {other for other in criterion.in_order if not _compares(criterion, wanted, other)}
    return not others or 2 * sum(_compares(criterion, text, other) for other in others) < len(others)


def _out_of_order(criterion: TextSequence, chosen: Sequence[Line], found: Sequence[Line], deed: Deed) -> Strays:
    """Return the strays: other lines that count or match a required text, in addition to those found."""
    if criterion.only:
        # Each additional text has already lowered the score.
        return Strays("")
    taken = set(map(id, found))
    # A loop that repeats one text does not name everything.
    changed = [line for place, line in enumerate(chosen) if not place or line.text != chosen[place - 1].text]
    every = criterion.has_conditions or deed.addressed
    extra = sum(
        every or any(_compares(criterion, line.text, text) for text in criterion.in_order)
        for line in changed
        if id(line) not in taken
    )
    words = f"such texts were {deed.past} {extra} times at the wrong point"
    # A text that only contains "1" may be about anything.
    sure = every or criterion.compare == "equals"
    return Strays(words, misplaced=extra) if sure else Strays(words, others=extra)


def _judge_count(
    criterion: TextSequence, chosen: Sequence[Line], lines: Sequence[Line], deed: Deed, recording: Recording
) -> Outcome:
    least, most = _bounds(criterion)
    what = conditions(criterion) or "something"
    count = len(chosen)
    last = chosen[-1] if chosen else None
    at = last.t if last else None
    pose = pose_at(recording, last.t) if last else None
    if count >= least and (most is None or count <= most):
        if last is None:
            return passed(f"{deed.who.capitalize()} {deed.past} no forbidden text.")
        again = f" ({count} such texts)" if count > 1 else ""
        return passed(f"{deed.who.capitalize()} {deed.past} {quoted(last.text)}{again}.", at, pose)
    times = _times(least, most)
    expected = f"Expected {deed.who} to {deed.verb} {what}{times}"
    if count == 0:
        return failed(f"{expected}, but {_instead(lines, deed)}.")
    score = Fraction(count, least) if count < least else Fraction(most or 0, count)
    return failed(f"{expected}, but it {deed.past} {count} such, the last {quoted(chosen[-1].text)}.", at, pose, score)


def _beside(criterion: TextSequence, lines: Sequence[Line], chosen: Sequence[Line], deed: Deed) -> Strays:
    """Return the strays: lines in addition to the required ones.

    Lines that differ only in numbers count once, unless they differ from a required line only in numbers: then each
    counts.
    """
    if not (chosen and criterion.has_conditions and _bounds(criterion)[0]):
        return Strays("")
    guessed = {_form(line.text) for line in chosen}
    counted = set(map(id, chosen))
    forms = [_form(line.text) for line in lines if id(line) not in counted]
    others = sum(form in guessed for form in forms) + len(set(forms) - guessed)
    return Strays(f"it {deed.past} {others} others as well", others=others)


def _form(text: str) -> str:
    """Return a text without its numbers."""
    return _NUMBER.sub("#", " ".join(text[:_LONG].casefold().split()))


def _bounds(criterion: TextSequence) -> tuple[int, int | None]:
    if criterion.exactly is not None:
        return criterion.exactly, criterion.exactly
    if criterion.at_least is None and criterion.at_most is None:
        return 1, None
    return criterion.at_least or 0, criterion.at_most


def _times(least: int, most: int | None) -> str:
    if most is None:
        return "" if least == 1 else f" at least {least} times"
    if most == least:
        return " exactly once" if least == 1 else f" exactly {least} times"
    return f" at most {most} times" if least == 0 else f" {least} to {most} times"


def _instead(lines: Sequence[Line], deed: Deed) -> str:
    if not lines:
        return f"it {deed.past} nothing"
    if len(lines) == 1:
        return f"it {deed.past} {quoted(lines[0].text)}"
    return f"it {deed.past} {len(lines)} other texts, the last {quoted(lines[-1].text)}"


def _judge_texts(criterion: Messages, recording: Recording) -> Outcome:
    if not criterion.json_queue:
        pair = pair_of(criterion, recording)
        sent = [Line(message.t, message.text) for message in pair.recording.messages if message.sender == "robot"]
        deed = Deed(pair.teller, f"tell {pair.told}", f"told {pair.told}") if criterion.agents else _SEND
        return judge_sequence(criterion, sent, deed, recording)
    arrived = [message for message in recording.messages if _joined(message)]
    as_arrived = [(message.delivered or 0.0, message.received) for message in arrived]
    outcome = judge_sequence(criterion, _lines(criterion, as_arrived), _RECEIVE, recording)
    astray = [message for message in recording.messages if message.sender == "responder" and by_chance(message)]
    if outcome.passed or not astray:
        return outcome
    # Judge the answers as if there were no random losses, because the program cannot prevent them.
    as_answered = {id(message): (message.delivered or message.t, message.text) for message in (*arrived, *astray)}
    excused = judge_sequence(criterion, _lines(criterion, as_answered.values()), _RECEIVE, recording)
    if excused.score <= outcome.score:
        return outcome
    return replace(excused, message=f"{excused.message} {_EXCUSED}")


def _lines(criterion: Messages, answers: Iterable[tuple[float, str]]) -> list[Line]:
    """Return the answers that join the robot's queue, in order of time, reduced to the requested value."""
    lines = []
    for t, text in sorted(answers, key=lambda answer: answer[0]):
        value = parsed(text)
        value = value if value is NOTHING or criterion.path is None else at_path(value, criterion.path)
        if value is not NOTHING:
            lines.append(Line(t, as_text(value)))
    return lines


def _joined(message: Message) -> bool:
    """Return whether it is an answer that joined the robot's queue."""
    if message.sender != "responder" or message.delivered is None:
        return False
    if message.arrived_as is not None:
        return is_json_answer(message.arrived_as)
    return message.text.startswith(JSON) and message.note != "malformed"


def _queue_grows(recording: Recording) -> Outcome:
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
        astray = next((message for _, message in sent if out_of_reach(message)), None)
        if sent and not astray:
            return passed("The channel lost every PY:: message by chance, so there were no answers to queue.")
        lost = f"the channel lost {quoted(astray.text)} ({loss_words(astray)})" if astray else ""
        return failed(f"{expected}, but {lost or 'the robot sent no PY:: message'}.")
    answers = Answers(recording)
    replies = [(message, _reply(answers, index)) for index, message in asked]
    arrivals = [reply.delivered for _, reply in replies if reply is not None and _joined(reply)]
    came = {message.text for message, reply in replies if reply is not None and _joined(reply)}
    # A repeated message shows nothing new.
    different = {message.text for _, message in asked}
    missed = [(message, reply) for message, reply in replies if not _excused(message, reply, came)]
    score = Fraction(len(different - {message.text for message, _ in missed}), len(different))
    for message, reply in missed:
        happened = "got no answer" if reply is None else f"was answered with {quoted(reply.text)}"
        if reply is not None and reply.delivered is None and reply.note == "undelivered":
            happened = "got its answer only after the program had ended"
        if reply is not None and out_of_reach(reply):
            happened = f"was answered and the channel lost the answer ({loss_words(reply)})"
        return failed(
            f"{expected}, but {quoted(message.text)} {happened} ({len(arrivals)} of {len(asked)} in the queue).",
            message.t,
            pose_at(recording, message.t),
            score,
        )
    if not arrivals:
        return passed("The channel lost every answer by chance.")
    times = [arrived or 0.0 for arrived in arrivals]
    if times != sorted(times):
        return failed(f"{expected}, but the answers arrived in another order.", times[-1], None, score)
    return passed(
        f"The robot's queue grew by one for each of {len(arrivals)} messages.",
        times[-1],
        pose_at(recording, times[-1]),
    )


def _reply(answers: Answers, index: int) -> Message | None:
    """Return the answer that joined the queue, the first of several copies; otherwise the first answer."""
    return next(filter(_joined, answers.all_to(index)), answers.to(index))


def _excused(message: Message, reply: Message | None, came: Container[str]) -> bool:
    """Return whether a message's answer is in the queue, or missing only because of the channel."""
    if reply is None:
        return False
    return _joined(reply) or by_chance(reply) or (out_of_reach(reply) and message.text in came)


def _compares(criterion: TextSequence, text: str, wanted: str) -> bool:
    fold = criterion.ignore_case
    match criterion.compare:
        case "equals":
            return same_text(text, wanted, fold)
        case "contains":
            return _plain(wanted, fold) in _plain(text, fold)
        case "starts_with":
            return _plain(text, fold).startswith(_plain(wanted, fold))
        case "matches":
            return found_in(text, wanted, fold)


def _named(choices: Sequence[str], text: str) -> list[str]:
    """Return the choices that a text contains as whole words."""
    words = words_of(text)
    return [choice for choice in choices if find_words(words, words_of(choice)) is not None]


def _plain(text: str, ignore_case: bool) -> str:
    plain = " ".join(text.split())
    return plain.casefold() if ignore_case else plain
