"""A sentence on a cause claims nothing that its reruns did not show, whatever the reruns are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import Decimal
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from judging import recorded, talk
from service.grading.reruns.cause_sentences import build_shown_causes, describe_cause
from service.grading.reruns.causes import Cause, CauseKind
from service.grading.reruns.engine import Rerun, RerunOutcome
from service.grading.reruns.exchanges import (
    AnswersFrom,
    ChangedLine,
    ChangeKind,
    Exchange,
    GivenPart,
    MoreTime,
    OtherNoise,
    VisibleStart,
    WithoutChannelEffect,
    WithoutLightNoise,
    WithoutMessageLoss,
    WithoutMotorNoise,
)
from service.grading.reruns.mildest import Conditions, ScaledConditions
from sim.recording import Pose

pytestmark = pytest.mark.fast

PLAN = cast(Any, None)
ANSWERS = st.lists(st.sampled_from(["1", "2", None]), min_size=1, max_size=4)
CONDITIONS: tuple[Exchange, ...] = (
    WithoutLightNoise(),
    WithoutMotorNoise(),
    WithoutMessageLoss(),
    WithoutChannelEffect("corruption"),
)
LINES: dict[ChangeKind, str] = {
    "changed": "With one change in line 8",
    "added": "With one more statement after line 8",
    "wait": "With a wait after line 8",
    "removed": "Without the statement in line 8",
}
WORDS = {
    "the light noise off": WithoutLightNoise(),
    "the motor noise off": WithoutMotorNoise(),
    "no message lost": WithoutMessageLoss(),
    "no message changed": WithoutChannelEffect("corruption"),
}


@st.composite
def reruns(draw: st.DrawFn, exchanges: st.SearchStrategy[tuple[Exchange, ...]]) -> Rerun:
    """Return a rerun of one to three trials with any outcome that an engine can give."""
    trials = range(draw(st.integers(1, 3)))
    own, other = draw(ANSWERS), draw(ANSWERS)
    passed = frozenset(trial for trial in trials if draw(st.booleans()))
    failed_before = frozenset(trial for trial in trials if draw(st.booleans()))
    is_whole = draw(st.booleans())
    max_marks = Decimal(draw(st.sampled_from(["1", "4", "2.50"])))
    lost = Decimal(0) if draw(st.booleans()) else Decimal("0.5")
    return Rerun(
        draw(exchanges),
        {trial: recorded(messages=talk(*(("PY::a", each) for each in own))) for trial in trials},
        {trial: recorded(messages=talk(*(("PY::a", each) for each in other))) for trial in trials},
        {"c": RerunOutcome(max_marks - lost, max_marks, passed, frozenset(trials) - passed, failed_before, is_whole)},
    )


def parts(*names: str) -> st.SearchStrategy[Rerun]:
    return reruns(st.just(tuple(GivenPart(name, PLAN) for name in names)))


ANSWER_PAIR = st.tuples(
    reruns(st.builds(lambda number: (AnswersFrom(number, PLAN, recorded()),), st.integers(1, 4))),
    reruns(st.builds(lambda number: (AnswersFrom(number, PLAN, recorded()),), st.integers(1, 4))),
)
TWO_PARTS = st.tuples(parts("program"), parts("responder"))
THREE_PARTS = st.tuples(
    *(parts(name) for name in ("parser", "agent", "logger")),
    *(parts(*names) for names in (("agent", "logger"), ("parser", "logger"), ("parser", "agent"))),
)
EASY_AND_HARD = st.tuples(
    *(
        st.builds(
            Conditions,
            st.sampled_from([0.0, 8.0]),
            st.sampled_from([0.0, 20.0]),
            st.sampled_from([0.0, 0.4]),
            st.builds(Pose, st.sampled_from([100.0, 500.0]), st.just(800.0), st.sampled_from([0.0, 350.0])),
        )
        for _ in range(2)
    )
)


@st.composite
def mildest(draw: st.DrawFn) -> tuple[Rerun, Rerun]:
    """Return two reruns, a sixteenth of the way apart, with any outcomes."""
    (easy, hard), step = draw(EASY_AND_HARD), draw(st.integers(0, 15))
    passing, failing = (ScaledConditions(each / 16, easy, hard) for each in (step, step + 1))
    return draw(reruns(st.just((passing,)))), draw(reruns(st.just((failing,))))


CAUSES: dict[CauseKind, st.SearchStrategy[tuple[Rerun, ...]]] = {
    "parts": st.one_of(TWO_PARTS, THREE_PARTS, st.builds(lambda a, b: (*a, *b), TWO_PARTS, ANSWER_PAIR)),
    "conditions": st.tuples(
        reruns(st.builds(tuple, st.lists(st.sampled_from(CONDITIONS), min_size=1, max_size=3, unique=True))),
        reruns(st.builds(lambda numbers: (WithoutMessageLoss(numbers),), st.frozensets(st.integers(1, 9), min_size=1))),
    ),
    "chance": st.builds(tuple, st.lists(reruns(st.just((OtherNoise(1),))), min_size=1, max_size=5)),
    "line": st.tuples(
        reruns(
            st.sampled_from(list(LINES)).map(
                lambda kind: (ChangedLine("program", 8, "<", ">", "", kind, "It is too short."),)
            )
        )
    ),
    "time": st.tuples(reruns(st.just((MoreTime(),)))),
    "start": st.tuples(reruns(st.just((VisibleStart(Pose(1, 2, 3), 0),)))),
    "mildest": mildest(),
}


def passes(rerun: Rerun) -> bool:
    """Return whether nothing was lost, by the definition in the documentation."""
    outcome = rerun.outcomes["c"]
    if outcome.is_whole:
        return outcome.marks == outcome.max_marks
    return not outcome.failed and bool(outcome.failed_before)


def loses(rerun: Rerun) -> bool:
    """Return whether marks are still lost."""
    outcome = rerun.outcomes["c"]
    return outcome.marks < outcome.max_marks if outcome.is_whole else bool(outcome.failed)


def with_part(cause: Cause, *names: str) -> Rerun:
    """Return the rerun with exactly these parts of the reference."""
    return next(
        rerun
        for rerun in cause.reruns
        if all(isinstance(each, GivenPart) for each in rerun.exchanges)
        and tuple(cast(GivenPart, each).part for each in rerun.exchanges) == names
    )


def check_result(sentence: str, rerun: Rerun) -> None:
    """Check the number of marks or trials in a sentence against the rerun that it is about."""
    outcome = rerun.outcomes["c"]
    assert passes(rerun)
    marks = re.search(r"gets all ([\d.]+) marks|gets the mark", sentence)
    trials = re.search(r"in all (\d) trials that were run again|in the trial that was run again", sentence)
    assert (marks is None) != (trials is None)
    if marks is not None:
        assert outcome.is_whole
        assert Decimal(marks[1] or 1) == outcome.marks == outcome.max_marks
    if trials is not None:
        assert not outcome.is_whole
        assert int(trials[1] or 1) == len(rerun.trials) == len(outcome.passed)


def check_parts(text: str, cause: Cause) -> None:
    for part, other in (("responder", "program"), ("program", "responder")):
        if f"the {part} loses the marks" in text:
            check_result(text.split(": the ")[0], with_part(cause, part))
        if f"ith the reference's {part} in place of yours, your {other} still loses" in text:
            assert loses(with_part(cause, part))
    if "do not fit together" in text:
        first, second = text.split(". ")[:2]
        check_result(first, with_part(cause, "responder"))
        check_result(second, with_part(cause, "program"))
    names = re.search(r"(?:loses marks|loses no marks): (.+)\.$", text)
    for name in (each.removesuffix(".py") for each in (re.split(", | and ", names[1]) if names else ())):
        others = tuple(each for each in ("parser", "agent", "logger") if each != name)
        if "loses no marks" in text:
            assert passes(with_part(cause, name))
        else:
            assert loses(with_part(cause, *others))
    for name in re.findall(r"With the reference's (\w+)\.py in place", text):
        check_result(text, with_part(cause, name))
    for name in re.findall(r"your (\w+)\.py still loses", text):
        assert loses(with_part(cause, *(each for each in ("parser", "agent", "logger") if each != name)))


def check_answers(text: str, cause: Cause) -> None:
    difference = re.search(r"The first answer that differs is number (\d)", text)
    if difference is not None:
        rerun = with_part(cause, "responder")
        first = [
            [message.text for message in recording.messages if message.sender == "responder" or message.text]
            for recording in (rerun.originals[0], rerun.recordings[0])
        ]
        assert first[0] != first[1]
        number = int(difference[1])
        assert answers(rerun.originals[0])[: number - 1] == answers(rerun.recordings[0])[: number - 1]
        assert answers(rerun.originals[0])[number - 1] != answers(rerun.recordings[0])[number - 1]
    bounds = re.search(r"answers from number (\d) on, the trial passes; from number (\d) on, it still fails", text)
    if bounds is not None:
        results = {
            exchange.number: passes(rerun)
            for rerun in cause.reruns
            for exchange in rerun.exchanges
            if isinstance(exchange, AnswersFrom)
        }
        assert int(bounds[2]) == int(bounds[1]) + 1
        assert results[int(bounds[1])]
        assert not results[int(bounds[2])]


def answers(recording: Any) -> list[str | None]:
    texts = [index for index, each in enumerate(recording.messages) if each.sender == "robot"]
    replies = {each.reply_to: each.text for each in recording.messages if each.sender == "responder"}
    return [replies.get(index) for index in texts]


def check_conditions(text: str, cause: Cause) -> None:
    first, second = cause.reruns
    sentence = text.split(". ")[0]
    check_result(sentence, first)
    assert {exchange for words, exchange in WORDS.items() if words in sentence} == set(first.exchanges)
    if "it is enough" in text:
        (exchange,) = second.exchanges
        assert isinstance(exchange, WithoutMessageLoss)
        assert passes(second)
        named = re.search(r"that messages? ([\d, and]+) and (?:its|their)", text)
        assert named is not None
        assert {int(each) for each in re.findall(r"\d", named[1])} == exchange.numbers


def check_mildest(text: str, cause: Cause) -> None:
    """Check that the sentence has the values of both reruns, and only those that differ."""
    assert [passes(rerun) for rerun in cause.reruns] == [True, False]
    halves = re.fullmatch(r"With (.+), one failed trial passes; with (.+), it fails\.", text)
    assert halves is not None
    conditions = [cast(ScaledConditions, rerun.exchanges[0]).conditions for rerun in cause.reruns]
    for half, own, other in zip(halves.groups(), conditions, reversed(conditions), strict=True):
        values = {
            r"light noise of ([\d.]+)": (own.light_noise, other.light_noise),
            r"motor noise of ([\d.]+)": (own.motor_noise, other.motor_noise),
            r"message loss of ([\d.]+) %": (100 * own.loss, 100 * other.loss),
            r"start at x ([\d.]+)": (own.pose.x, other.pose.x),
            r"heading (-?[\d.]+)": (own.pose.heading, other.pose.heading),
        }
        for pattern, (own_value, other_value) in values.items():
            named = re.search(pattern, half)
            assert own_value == other_value or named is not None
            assert named is None or float(named[1]) == pytest.approx(own_value, abs=0.01)


def check_claims(text: str, cause: Cause) -> None:
    """Check every claim of the sentence against the reruns."""
    match cause.kind:
        case "parts":
            check_parts(text, cause)
            check_answers(text, cause)
        case "conditions":
            check_conditions(text, cause)
        case "chance":
            numbers = re.findall(r"\d+", text)
            assert numbers == [str(len(cause.reruns)), str(sum(map(passes, cause.reruns)))]
        case "line":
            check_result(text.removesuffix(" It is too short."), cause.reruns[0])
            (change,) = cause.reruns[0].exchanges
            assert isinstance(change, ChangedLine)
            assert text.startswith(f"{LINES[change.kind]} of robot.py, the same submission ")
        case "time":
            check_result(text, cause.reruns[0])
            assert "With 2 times the simulated time" in text
        case "start":
            assert passes(cause.reruns[0])
            assert "x 1, y 2, heading 3 degrees" in text
        case "mildest":
            check_mildest(text, cause)


@pytest.mark.parametrize("kind", CAUSES)
@settings(max_examples=50)
@given(data=st.data())
def test_sentence_claims_only_what_the_reruns_showed(kind: CauseKind, data: st.DataObject) -> None:
    cause = Cause("c", kind, data.draw(CAUSES[kind]))
    text = describe_cause(cause)
    if text:
        check_claims(text, cause)
    elif kind == "mildest":
        passing, failing = cause.reruns
        is_same = cast(ScaledConditions, passing.exchanges[0]).easy == cast(ScaledConditions, passing.exchanges[0]).hard
        assert is_same or not passes(passing) or not failing.loses("c")
    elif kind != "parts":
        assert not any(passes(rerun) for rerun in cause.reruns[:1]) or kind == "chance"


@pytest.mark.parametrize(("reveals", "for_staff"), [(0, [True, True]), (1, [False, True]), (2, [False, False])])
def test_only_so_many_hidden_causes_are_revealed(reveals: int, for_staff: Sequence[bool]) -> None:
    outcome = RerunOutcome(Decimal(4), Decimal(4), frozenset({0}), frozenset(), frozenset({0}), True)
    rerun = Rerun((WithoutLightNoise(),), {0: recorded()}, {0: recorded()}, {"a": outcome, "b": outcome, "c": outcome})
    causes = [
        Cause("a", "conditions", (rerun,), is_hidden=True),
        Cause("b", "conditions", (rerun,), is_hidden=True),
        Cause("c", "conditions", (rerun,)),
    ]
    shown = build_shown_causes(causes, reveals)
    assert [each.for_staff for each in shown] == [*for_staff, False]
    assert [each.text.startswith("In a hidden trial: ") for each in shown] == [True, True, False]
