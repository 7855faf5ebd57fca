"""Assignments without Python checks: alternatives, answers in order, figures, events, printed cells."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from driving import driven, passes, rest, spin, straight
from judging import criterion, judged, lines, recorded, talk
from sim.recording import Message, TimedText

ASKED = talk(("PY::0", "zero"), ("PY::1", "one"))


@pytest.mark.parametrize(
    ("answers", "marks"),
    [(["zero", "nought"], 4), (["nought", "zero"], 4), (["nought", "nil"], 0), ("zero", 4)],
)
def test_an_answer_may_have_alternatives(answers: Any, marks: int) -> None:
    wanted = {"one_of": answers} if isinstance(answers, list) else answers
    result = judged(criterion("replies", expect={"PY::0": wanted}), recorded(messages=ASKED))
    assert result.marks == marks
    if not marks:
        assert 'with "nought" or "nil", but it answered "zero"' in result.message


def test_alternatives_apply_to_json_as_well() -> None:
    messages = talk(("PY::0", 'JSON::{"shape": "rectangle"}'))
    keys = {"path": "shape", "expect": {"PY::0": {"one_of": ["square", "rectangle"]}}}
    assert judged(criterion("replies", **keys), recorded(messages=messages)).marks == 4


def test_an_alternative_that_is_no_text_needs_a_path() -> None:
    with pytest.raises(ValidationError, match="has an answer in expect that is not a text"):
        criterion("replies", expect={"PY::0": {"one_of": ["zero", 0]}})


@pytest.mark.parametrize(
    ("in_order", "share", "words"),
    [
        (["zero", "one"], 4, "answered 2 of 2"),
        (["one", "zero"], 0, 'to answer "PY::0" with "one", but it answered "zero" (0 of 2 right)'),
        (["zero", "two"], 0, '"PY::1" with "two", but it answered "one" (1 of 2 right)'),
        (["zero"], 0, "to answer 1 messages, but 2 reached it"),
        (["zero", "one", "two"], 0, "to answer 3 messages, but 2 reached it"),
    ],
)
def test_answers_are_compared_in_order(in_order: list[str], share: int, words: str) -> None:
    result = judged(criterion("replies", in_order=in_order), recorded(messages=ASKED))
    assert (result.marks, words in result.message) == (share, True), result.message


def test_answers_in_order_give_a_share_where_that_is_asked_for() -> None:
    result = judged(criterion("replies", in_order=["zero", "two"], over="mean"), recorded(messages=ASKED))
    assert result.marks == 2


def figure(side: float, legs: int) -> list[Any]:
    turn = 360 / legs
    return [part for _ in range(legs) for part in (straight(side), rest(), spin(turn), rest())]


@pytest.mark.parametrize(
    ("moves", "keys", "good"),
    [
        ([*figure(200, 3), *figure(200, 4)], {"legs": [3, 4], "angle": [120, 90]}, True),
        ([*figure(200, 4), *figure(200, 3)], {"legs": [3, 4], "angle": [120, 90]}, False),
        ([*figure(200, 3)], {"legs": [3, 4], "angle": [120, 90]}, False),
        ([*figure(200, 3), *figure(200, 4), straight(200)], {"legs": [3, 4], "angle": [120, 90]}, False),
        ([*figure(200, 3), *figure(200, 4)], {"legs": [3, 4]}, False),
    ],
)
def test_figures_may_have_different_numbers_of_legs(moves: list[Any], keys: dict[str, Any], good: bool) -> None:
    assert passes(criterion("drawing", closes=True, **keys), driven(*moves)) is good


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"legs": [3, 4], "figures": 3}, "has 2 numbers in legs, expected one for each of 3 figures"),
        ({"legs": [3, 4], "angle": [90]}, "has 1 numbers in angle, expected one for each of 2 figures"),
        ({"legs": [3, 4], "at_least": True}, "has at_least beside a list of legs"),
    ],
)
def test_lists_of_figures_must_fit(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words.replace("[", r"\[")):
        criterion("drawing", **keys)


OUTPUT = "--- cell 3 ---\nmean 4.5\n--- cell 5 ---\nmedian 4"


@pytest.mark.parametrize(
    ("keys", "marks"),
    [
        ({"in_order": ["mean 4.5", "median 4"], "only": True}, 4),
        ({"contains": "median"}, 4),
        ({"contains": "maximum"}, 0),
        ({"contains": "cell"}, 0),
    ],
)
def test_what_cells_print_can_be_marked(keys: dict[str, Any], marks: int) -> None:
    recording = recorded(responder_output=OUTPUT, printed=lines("maximum"))
    assert judged(criterion("prints", of="responder", **keys), recording).marks == marks


#: The robot drives 1 mm a tick (30 mm/s) and ends after 3 s at x = 190. The answer arrives at 2.1 s.
STOP = (Message(2.0, "robot", "PY::near", 2.0), Message(2.0, "responder", "please stop", 2.1, 0, ""))


@pytest.mark.parametrize(
    ("since", "words"),
    [
        ({"of": "answered", "contains": "stop", "moved": [0, 40]}, ""),
        ({"of": "answered", "contains": "stop", "moved": [0, 20]}, 'from where it was when "stop" was answered'),
        ({"of": "sent", "contains": "near", "seconds": [0.9, 1.1]}, ""),
        ({"of": "sent", "contains": "near", "seconds": [0, 0.5]}, '0 to 0.5 s after "near" was sent'),
        ({"of": "said", "contains": "there", "moved": [80, 100]}, ""),
        ({"of": "printed", "contains": "near", "moved": [0, 40]}, "but it never was"),
    ],
)
def test_the_end_may_be_asked_relative_to_an_event(since: dict[str, Any], words: str) -> None:
    recording = recorded(messages=STOP, spoken=(TimedText(0.0, "there"),))
    result = judged(criterion("pose", since=since), recording)
    assert (result.marks == 4, words in result.message) == (not words, True), result.message


def test_an_event_without_bounds_asks_for_nothing() -> None:
    with pytest.raises(ValidationError, match="has no condition, expected moved"):
        criterion("pose", since={"of": "sent", "contains": "near"})
