"""Judging with recordings made by hand: passing, messages and marks."""

from __future__ import annotations

from typing import Any

import pytest

from judging import criterion, judged, lines, recorded, talk
from service.grading.judging.answers import MISSING, find_at_path, is_same_value, parse_json_answer
from sim.recording import Fault, Message, Pose, Verdict

pytestmark = pytest.mark.fast


def fault(verdict: Verdict, who: Any = "program", t: float = 2.0, line: int | None = 7) -> Fault:
    return Fault(t, verdict, who, "NameError: name 'x' is not defined", line)


@pytest.mark.parametrize(
    ("verdict", "faults", "passes"),
    [
        (Verdict.FINISHED, (), True),
        (Verdict.PROGRAM_ERROR, (fault(Verdict.PROGRAM_ERROR),), False),
        (Verdict.TIME_LIMIT, (), False),
        (Verdict.CPU_LIMIT, (fault(Verdict.CPU_LIMIT),), False),
        (Verdict.RESPONDER_ERROR, (fault(Verdict.RESPONDER_ERROR, "responder"),), True),
        (Verdict.PROTOCOL_ERROR, (fault(Verdict.PROTOCOL_ERROR, "responder"),), True),
        (Verdict.CPU_LIMIT, (fault(Verdict.CPU_LIMIT, "responder"),), True),
        (
            Verdict.RESPONDER_ERROR,
            (fault(Verdict.RESPONDER_ERROR, "responder", 1), fault(Verdict.TIME_LIMIT, "program", 3)),
            False,
        ),
    ],
)
def test_program_finishes_unless_it_was_cut(verdict: Verdict, faults: tuple[Fault, ...], passes: bool) -> None:
    result = judged(criterion("finishes"), recorded(verdict=verdict, faults=faults))
    assert result.marks == (4 if passes else 0)


def test_finishing_late_and_what_is_said_of_a_fault() -> None:
    assert judged(criterion("finishes", seconds=3), recorded()).marks == 4
    late = judged(criterion("finishes", seconds=2.5), recorded())
    assert late.marks == 0
    assert "within 2.5 s, but it took 3.00 s" in late.message
    broken = recorded(verdict=Verdict.PROGRAM_ERROR, faults=(fault(Verdict.PROGRAM_ERROR),))
    assert judged(criterion("finishes"), broken).message == (
        "In scenario s, from (100, 800) facing 0°, at 2.00 s: Expected the program to end by itself, but after 2.00 s: "
        "NameError: name 'x' is not defined (line 7)."
    )


@pytest.mark.parametrize(
    ("keys", "spoken_texts", "passes"),
    [
        ({"equals": "all done"}, ["a", " all  done "], True),
        ({"equals": "all done"}, ["All done"], False),
        ({"equals": "all done", "ignore_case": True}, ["All Done"], True),
        ({"equals": ["yes", "no"]}, ["no"], True),
        ({"contains": ["a", "b"]}, ["b and a"], True),
        ({"contains": ["a", "b"]}, ["a", "b"], False),
        ({"starts_with": "I see"}, ["I see grey"], True),
        ({"matches": r"^\d+$"}, ["12"], True),
        ({"matches": r"^\d+$"}, ["12a"], False),
        ({"matches": "GREY", "ignore_case": True}, ["I see grey"], True),
        ({"equals": "x", "last": True}, ["x", "y"], False),
        ({"equals": "y", "last": True}, ["x", "y"], True),
        ({"equals": "y", "last": True}, [], False),
        ({"in_order": ["1", "2", "3"]}, ["0", "1", "x", "2", "3", "4"], True),
        ({"in_order": ["1", "2", "3"]}, ["1", "3", "2"], False),
        ({"in_order": ["1", "2"], "only": True}, ["1", "2"], True),
        ({"in_order": ["1", "2"], "only": True}, ["1", "2", "2"], False),
        ({"in_order": ["1", "2"], "only": True, "matches": r"^\d$"}, ["one", "1", "2"], True),
        ({"in_order": ["T", "M"], "compare": "starts_with"}, ["Tee", "Em", "Mmm"], True),
        ({"in_order": [r"\d", "[a-z]"], "compare": "matches"}, ["4", "b"], True),
        ({"contains": "tick", "at_least": 2}, ["tick", "tock"], False),
        ({"contains": "tick", "at_least": 2}, ["tick", "tick"], True),
        ({"contains": "tick", "exactly": 1}, ["tick", "tick"], False),
        ({"contains": "tick", "at_most": 1}, [], True),
        ({"contains": "TM129", "exactly": 0}, ["T M 1 2 9"], True),
        ({"contains": "TM129", "exactly": 0}, ["TM129"], False),
        ({"at_least": 1}, ["anything"], True),
    ],
)
@pytest.mark.parametrize("check", ["prints", "says"])
def test_texts_are_found(check: str, keys: dict[str, Any], spoken_texts: list[str], passes: bool) -> None:
    field = {"prints": "printed", "says": "spoken"}[check]
    result = judged(criterion(check, **keys), recorded(**{field: lines(*spoken_texts)}))
    assert result.marks == (4 if passes else 0), result.message


def test_reached_part_of_an_order_counts_with_mean() -> None:
    rule = criterion("says", in_order=["1", "2", "3", "4"], over="mean")
    cut = recorded(spoken=lines("1", "2", "3"), verdict=Verdict.TIME_LIMIT)
    result = judged(rule, cut)
    assert result.marks == 3
    assert (
        '"4" did not come after "3" (3 of 4 found). The program was still running when time ran out, at 3 s.'
        in result.message
    )
    assert result.evidence[0].t == 2.0
    assert result.evidence[0].pose == Pose(160, 800, 0)


def test_long_and_hostile_texts_are_shortened_and_do_not_hang() -> None:
    result = judged(criterion("prints", matches="(a+)+$"), recorded(printed=lines("b" * 1001 + "a" * 100_000 + "!")))
    assert result.marks == 0
    assert len(result.message) < 400


def test_messages_of_the_robot() -> None:
    run = recorded(messages=talk(("PY::0", "x"), ("IMG_DATA::{}", "y"), ("PY::2", None)))
    assert judged(criterion("messages", starts_with="PY::", in_order=["PY::0", "PY::2"], only=True), run).marks == 4
    assert judged(criterion("messages", starts_with="IMG_DATA", exactly=1), run).marks == 4
    assert judged(criterion("messages", equals="x"), run).marks == 0


def test_messages_in_the_queue_by_path() -> None:
    run = recorded(
        messages=talk(
            ("PY::0", 'JSON::{"message": {"shape": "square", "n": [1, 2]}}'), ("PY::1", "JSON::{"), ("PY::2", "plain")
        )
    )
    assert judged(criterion("messages", json=True, path="message.shape", equals="square"), run).marks == 4
    assert judged(criterion("messages", json=True, path="message.n.1", equals="2"), run).marks == 4
    assert judged(criterion("messages", json=True, path="message.n.7", at_least=1), run).marks == 0
    late = recorded(messages=talk(("PY::0", 'JSON::{"message": 1}'), arrives=False))
    assert judged(criterion("messages", json=True, at_least=1), late).marks == 0


def test_queue_grows_only_by_json_that_arrives_in_order() -> None:
    rule = criterion("messages", queue_grows=True, over="mean")
    good = talk(("PY::0", 'JSON::{"message": 0}'), ("PY::2", "JSON::1"))
    assert judged(rule, recorded(messages=good)).marks == 4
    plain = judged(rule, recorded(messages=talk(("PY::0", "JSON::0"), ("PY::2", "hello"))))
    assert plain.marks == 2
    assert '"PY::2" was answered with "hello" (1 of 2 in the queue)' in plain.message
    late = judged(rule, recorded(messages=talk(("PY::0", "JSON::0"), arrives=False)))
    assert "only after the program had ended" in late.message
    swapped = (
        Message(0, "robot", "PY::0", 0),
        Message(0, "responder", "JSON::0", 2.0, 0),
        Message(1, "robot", "PY::1", 1),
        Message(1, "responder", "JSON::1", 1.1, 2),
    )
    disorder = judged(criterion("messages", queue_grows=True), recorded(messages=swapped))
    assert disorder.marks == 0
    assert "another order" in disorder.message
    assert judged(rule, recorded()).marks == 0
    lost = (*good, Message(2, "robot", "PY::3", None, note="lost"))
    assert judged(rule, recorded(messages=lost)).marks == 4
    both = criterion("messages", queue_grows=True, exactly=3)
    assert "exactly 3 times" in judged(both, recorded(messages=good)).message


@pytest.mark.parametrize(
    ("keys", "answer", "passes"),
    [
        ({"equals": "saw 0"}, "saw 0", True),
        ({"equals": "saw 0"}, "saw 1", False),
        ({"contains": "0"}, None, False),
        ({"is_json": True}, 'JSON::{"a": 1}', True),
        ({"is_json": True}, '{"a": 1}', False),
        ({"is_json": True}, "JSON::{'a': 1}", False),
        ({"path": "a", "value": 1}, 'JSON::{"a": 1.0}', True),
        ({"path": "a", "value": 1}, 'JSON::{"a": true}', False),
        ({"path": "a", "value": [1, "x"]}, 'JSON::{"a": [1, "x "]}', True),
        ({"path": "a.b"}, 'JSON::{"a": 1}', False),
        ({"path": "message", "contains": "typ"}, "JSON::{\"message\": \"{'typ': 'PY'}\"}", True),
        ({"expect": {"PY::0": "saw 0"}}, "saw  0", True),
        ({"expect": {"PY::0": "saw 0", "PY::1": "saw 1"}}, "saw 0", False),
        ({"expect": {"PY::0": {"n": 0}}, "path": "m"}, 'JSON::{"m": {"n": 0}}', True),
        ({"to": "PY::1", "equals": "saw 1"}, "saw 1", False),
        ({"to_starts_with": "IMG", "at_least": 0}, "saw 0", True),
    ],
)
def test_replies_are_compared(keys: dict[str, Any], answer: str | None, passes: bool) -> None:
    result = judged(criterion("replies", **keys), recorded(messages=talk(("PY::0", answer))))
    assert result.marks == (4 if passes else 0), result.message


def test_undelivered_replies_count_and_the_share_answered_with_mean() -> None:
    rule = criterion("replies", contains="saw", over="mean")
    run = recorded(messages=talk(("PY::0", "saw"), ("PY::1", "said"), arrives=False))
    result = judged(rule, run)
    assert result.marks == 2
    assert (
        'at 1.00 s: Expected the responder to answer "PY::1" with something that contains "saw", '
        'but it answered "said" (1 of 2 answered as expected).' in result.message
    )


def test_a_silent_responder_is_told_why() -> None:
    run = recorded(
        messages=talk(("PY::0", "saw"), ("PY::1", None)),
        verdict=Verdict.RESPONDER_ERROR,
        faults=(fault(Verdict.RESPONDER_ERROR, "responder", 1.0, 12),),
    )
    result = judged(criterion("replies", contains="saw"), run)
    assert "but there was no answer: NameError: name 'x' is not defined (line 12)" in result.message
    assert "ended early" not in result.message


def test_messages_that_the_channel_lost_or_doubled_are_no_fault_of_the_responder() -> None:
    messages = (
        Message(0, "robot", "PY::0", 0, note="duplicated"),
        Message(0, "responder", "saw", 0.1, 0),
        Message(0, "responder", "saw", 0.2, 0, note="duplicated"),
        Message(1, "robot", "PY::1", None, note="lost"),
    )
    assert judged(criterion("replies", equals="saw"), recorded(messages=messages)).marks == 4


@pytest.mark.parametrize("text", ["JSON::", "JSON::" + "[" * 100_000, "JSON::" + "1" * 10_000, "JSON::NaN", "hello"])
def test_hostile_answers_are_nothing(text: str) -> None:
    assert parse_json_answer(text) is MISSING


def test_paths_and_values() -> None:
    value = {"a": [{"b": None}], "c.d": 1}
    assert find_at_path(value, "a.0.b") is None
    assert find_at_path(value, "a.-1.b") is None
    for missing in ("a.1", "a.x", "a.0.b.c", "", "a..b", "c.d", "a.9999999999"):
        assert find_at_path(value, missing) is MISSING
    assert is_same_value({"x": [1, None]}, {"x": [1.0, None]})
    assert not is_same_value({"x": 1}, {"x": 1, "y": 2})
    assert not is_same_value("1", 1)


@pytest.mark.parametrize(
    ("keys", "end", "passes"),
    [
        ({"x": 300, "y": 400, "tolerance": 5}, Pose(303, 404, 9), True),
        ({"x": 300, "y": 400, "tolerance": 5}, Pose(303.1, 404, 9), False),
        ({"heading": 0, "heading_tolerance": 5}, Pose(0, 0, 715), True),
        ({"heading": 0, "heading_tolerance": 5}, Pose(0, 0, -6), False),
        ({"heading": 180, "heading_tolerance": 10}, Pose(0, 0, -175), True),
        ({"zone": [0, 0, 10, 20]}, Pose(10, 20, 0), True),
        ({"zone": [0, 0, 10, 20]}, Pose(10, 21, 0), False),
        ({"zone": [0, 0, 10, 20], "heading": 90}, Pose(1, 1, 0), False),
        ({"x": 0, "y": 0}, Pose(float("nan"), 0, 0), False),
    ],
)
def test_end_pose(keys: dict[str, Any], end: Pose, passes: bool) -> None:
    result = judged(criterion("pose", **keys), recorded(end=end))
    assert result.marks == (4 if passes else 0), result.message
