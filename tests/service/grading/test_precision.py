"""Listing every possible answer is not finding it: each search criterion, with honest and indiscriminate output."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import Any

import pytest

from driving import driven, straight
from judging import criterion, judged
from service.grading.judging.outcome import Strays, apply_stray_penalty, fail_with, pass_with
from sim.recording import DatalogEntry, Message, Recording, TimedText
from submissions.criteria import SCHEMAS
from submissions.criteria.common import CriterionWithStrays

ZONES = [{"text": "1", "zone": [120, 0, 140, 1143]}, {"text": "2", "zone": [160, 0, 180, 1143]}]
BEGINNINGS = ("all", "it is", "now", "I am", "we are", "you are")
_WORDS = ("done", "over", "there", "up", "ready", "finished", "in")
ENDS = (*_WORDS, *(f"{word} now" for word in _WORDS))
GUESSES = tuple(map(str, range(100)))


def drove(**parts: Any) -> Recording:
    """Return a run at 30 mm/s along x from x = 100, with the left sensor 30 mm ahead, over white."""
    return driven(straight(90, per_tick=1), **parts)


def build_texts(*texts: str, every: float = 0.02) -> tuple[TimedText, ...]:
    return tuple(TimedText(number * every, text) for number, text in enumerate(texts))


def sent(*texts: str) -> tuple[Message, ...]:
    return tuple(Message(number * 0.02, "robot", text, number * 0.02) for number, text in enumerate(texts))


def logged(*values: float, every: float = 0.02) -> tuple[DatalogEntry, ...]:
    return tuple(DatalogEntry(0.5 + number * every, "Light", value, None) for number, value in enumerate(values))


#: The kind, its options, the output of an honest program (full marks), and that of one that lists everything.
CASES: Sequence[tuple[str, dict[str, Any], dict[str, Any], dict[str, Any]]] = [
    (
        "events",
        {"events": ZONES, "source": "speech"},
        {
            "spoken": (
                TimedText(0.1, "1"),
                TimedText(0.2, "now 1"),
                TimedText(0.7, "looking for 2"),
                TimedText(1.2, "2"),
            )
        },
        {"spoken": (*(TimedText(t / 30, "1") for t in range(20)), *(TimedText(t / 30, "2") for t in range(31, 89)))},
    ),
    (
        "prints",
        {"in_order": ["3", "2", "1"], "compare": "contains", "starts_with": "Count"},
        {"printed": build_texts("Light 86.2", "Count 3", "Count 2", "Light 12", "Count 1", *["Light 100"] * 300)},
        {"printed": build_texts(*[f"Count {number % 10}" for number in range(40)])},
    ),
    (
        "prints",
        {"in_order": ["3", "2", "1"], "compare": "contains"},
        {"printed": build_texts("3 to go", "2 to go", "1 to go", *[f"Light {value}" for value in range(40, 60)])},
        {"printed": build_texts(*["1 2 3"] * 10)},
    ),
    (
        "prints",
        {"starts_with": "I predict", "among": ["left", "right"], "contains": "right"},
        {"printed": build_texts("I predict: it turns right")},
        {"printed": build_texts("I predict: left or right")},
    ),
    (
        "prints",
        {"equals": "The answer is 42"},
        {"printed": build_texts(*[f"Light: {value}" for value in range(100)], "The answer is 42")},
        {"printed": build_texts(*[f"The answer is {guess}" for guess in GUESSES])},
    ),
    (
        "says",
        {"equals": "all done"},
        {"spoken": build_texts("I begin", "there it is", "one more", "all done")},
        {"spoken": build_texts(*[f"{begin} {end}" for begin in BEGINNINGS for end in ENDS])},
    ),
    (
        "messages",
        {"in_order": ["PY::0", "PY::2"]},
        {"messages": sent("PY::0", "PY::1", "PY::2", "IMG_DATA::{}")},
        {"messages": sent(*["PY::2", "PY::0"] * 8)},
    ),
    (
        "messages",
        {"in_order": ["PY::1", "PY::2"]},
        {"messages": sent("PY::1", "PY::1", "PY::1", "PY::2", "PY::2", "PY::2", "PY::bye")},
        {"messages": sent(*[f"PY::{guess}" for guess in GUESSES])},
    ),
    (
        "messages",
        {"equals": "PY::17"},
        {"messages": sent("PY::hello", "PY::17")},
        {"messages": sent(*[f"PY::{guess}" for guess in GUESSES])},
    ),
    (
        "sequence",
        {"words": ["1", "2", "3"], "lead_in": True, "more": True},
        {"spoken": build_texts("In 1 minute I count", "1", "2", "3", "and that was it")},
        {"spoken": build_texts(*["1 3", "2 1", "3 2", "1 2 3"] * 5)},
    ),
    (
        "reports",
        {"expected": [[17]]},
        # A program may print readings and their count throughout the run.
        {"printed": tuple(TimedText(0.5 + n / 100, f"{n}: 100 %, 255") for n in range(100, 190)) + build_texts("17")},
        {"printed": build_texts(*GUESSES, every=0)},
    ),
    (
        "reports",
        {"expected": [["rows", 7], ["rows", 9], ["rows", 11]], "source": "reply"},
        {"messages": (Message(0, "responder", '{"rows": 7, "columns": 9, "black": 49, "box": [3, 4, 9, 12]}', 0.1),)},
        {"messages": (Message(0, "responder", '{"rows": [7, 8, 9, 10, 11]}', 0.1),)},
    ),
    (
        "datalog",
        {"series": "Light", "measured": "left light", "at_least": 20},
        {"datalog": logged(*[100] * 25, 37, 38, 39)},
        {"datalog": logged(*[float(guess) for guess in range(0, 101, 5)] * 20, every=0.005)},
    ),
]  # fmt: skip


@pytest.mark.parametrize(("check", "keys", "honest", "sprayed"), CASES)
def test_naming_everything_earns_less_than_a_third_and_honest_work_all(
    check: str, keys: dict[str, Any], honest: dict[str, Any], sprayed: dict[str, Any]
) -> None:
    rule = criterion(check, over="mean", **keys)
    fair, unfair = judged(rule, drove(**honest)), judged(rule, drove(**sprayed))
    assert fair.marks == fair.max_marks, fair.message
    assert 3 * unfair.marks < unfair.max_marks, unfair.message


def test_every_kind_that_looks_among_much_has_its_case() -> None:
    looking = {check for check, schema in SCHEMAS.items() if issubclass(schema, CriterionWithStrays)}
    assert looking == {check for check, *_ in CASES}


@pytest.mark.parametrize(
    ("forgiven", "wanted", "misplaced", "others", "score"),
    [
        (None, 4, 4, 0, 1),
        (None, 4, 8, 0, "0.5"),
        (None, 1, 0, 20, 1),
        (None, 1, 0, 80, "0.25"),
        (None, 1, 1, 20, "0.5"),
        (0, 4, 0, 0, 1),
        (0, 4, 4, 0, "0.5"),
        (100, 1, 50, 0, 1),
    ],
)
def test_strays_that_are_not_forgiven_count_like_more_that_did_not_come(
    forgiven: int | None, wanted: int, misplaced: int, others: int, score: str | int
) -> None:
    rule = criterion("says", at_least=1, strays=forgiven)
    assert isinstance(rule, CriterionWithStrays)
    strays = Strays("more came", misplaced, others)
    outcome = apply_stray_penalty(pass_with("All came."), rule, wanted, strays)
    assert (outcome.score, outcome.passed) == (Decimal(score), score == 1)
    assert ("more came" in outcome.message) == (score != 1)
    half = apply_stray_penalty(fail_with("Half came.", score=outcome.score / 2), rule, wanted, strays)
    assert half.score == outcome.score**2 / 2


def test_what_may_not_come_too_often_is_not_looked_for() -> None:
    many = build_texts(*[f"{begin} {end}" for begin in BEGINNINGS for end in ENDS])
    rule = criterion("prints", contains="done", at_most=20)
    assert judged(rule, drove(printed=many)).marks == 4


def test_a_loop_that_is_stuck_on_one_text_names_nothing_else() -> None:
    rule = criterion("prints", in_order=["0", "1", "2"], compare="contains", over="mean", starts_with="Robot")
    result = judged(rule, drove(printed=build_texts("Robot 0", *["Robot 1"] * 50)))
    assert result.marks == Decimal("2.67")


def test_a_log_is_called_made_up_where_most_of_it_is() -> None:
    """140 samples, of which two are real readings of the sensor."""
    rule = criterion("datalog", series="Light", measured="left light", at_least=40)
    result = judged(rule, drove(datalog=logged(100, 100, *[17.0] * 138)))
    assert "at least 40 samples of Light, but there are 2; 138 of 140 are not readings of the left" in result.message
    assert "not readings of the left light sensor" in result.message
