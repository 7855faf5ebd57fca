"""Judging with recordings made by hand: who passes, what is said, and what it is worth."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from judging import START, criterion, judged, recorded
from models.intervals import wilson
from service.grading.grade import Shown, TrialResult
from service.grading.judging.answers import NOTHING, at_path, parsed, same_value
from service.grading.judging.judge import judge
from service.grading.judging.marks import Over, earned, share_of, share_of_accuracy
from service.grading.judging.outcome import Outcome
from service.grading.judging.truths import NO_IMAGE
from sim.errors import HostError
from sim.recording import Fault, Image, Line, Message, Pose, Recording, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec

SQUARE, DIAMOND = "square", "diamond"


def talk(*exchanges: tuple[str, str | None], arrives: bool = True) -> tuple[Message, ...]:
    """Each robot's text a second after the last, and its answer a tenth later."""
    messages: list[Message] = []
    for t, (text, answer) in enumerate(exchanges):
        asked = len(messages)
        messages.append(Message(float(t), "robot", text, float(t)))
        if answer is not None:
            note = "" if arrives else "undelivered"
            messages.append(Message(float(t), "responder", answer, t + 0.1 if arrives else None, asked, note))
    return tuple(messages)


def lines(*texts: str) -> tuple[Line, ...]:
    return tuple(Line(float(t), text) for t, text in enumerate(texts))


def fault(verdict: Verdict, who: Any = "program", t: float = 2.0, line: int | None = 7) -> Fault:
    return Fault(t, verdict, who, "NameError: name 'x' is not defined", line)


# finishes


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


# prints and says


@pytest.mark.parametrize(
    ("keys", "said", "passes"),
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
def test_texts_are_found(check: str, keys: dict[str, Any], said: list[str], passes: bool) -> None:
    field = {"prints": "printed", "says": "spoken"}[check]
    result = judged(criterion(check, **keys), recorded(**{field: lines(*said)}))
    assert result.marks == (4 if passes else 0), result.message


def test_reached_part_of_an_order_counts_with_mean() -> None:
    asked = criterion("says", in_order=["1", "2", "3", "4"], over="mean")
    cut = recorded(spoken=lines("1", "2", "3"), verdict=Verdict.TIME_LIMIT)
    result = judged(asked, cut)
    assert result.marks == 3
    assert (
        '"4" did not come after "3" (3 of 4 found). The program was still running when the time was up, at 3 s.'
        in result.message
    )
    assert result.evidence[0].t == 2.0
    assert result.evidence[0].pose == Pose(160, 800, 0)


def test_long_and_hostile_texts_are_shortened_and_do_not_hang() -> None:
    result = judged(criterion("prints", matches="(a+)+$"), recorded(printed=lines("b" * 1001 + "a" * 100_000 + "!")))
    assert result.marks == 0
    assert len(result.message) < 400


# messages


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
    asked = criterion("messages", queue_grows=True, over="mean")
    good = talk(("PY::0", 'JSON::{"message": 0}'), ("PY::2", "JSON::1"))
    assert judged(asked, recorded(messages=good)).marks == 4
    plain = judged(asked, recorded(messages=talk(("PY::0", "JSON::0"), ("PY::2", "hello"))))
    assert plain.marks == 2
    assert '"PY::2" was answered with "hello" (1 of 2 in the queue)' in plain.message
    late = judged(asked, recorded(messages=talk(("PY::0", "JSON::0"), arrives=False)))
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
    assert judged(asked, recorded()).marks == 0
    lost = (*good, Message(2, "robot", "PY::3", None, note="lost"))
    assert judged(asked, recorded(messages=lost)).marks == 4
    both = criterion("messages", queue_grows=True, exactly=3)
    assert "exactly 3 times" in judged(both, recorded(messages=good)).message


# replies


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
    asked = criterion("replies", contains="saw", over="mean")
    run = recorded(messages=talk(("PY::0", "saw"), ("PY::1", "said"), arrives=False))
    result = judged(asked, run)
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
    assert parsed(text) is NOTHING


def test_paths_and_values() -> None:
    value = {"a": [{"b": None}], "c.d": 1}
    assert at_path(value, "a.0.b") is None
    assert at_path(value, "a.-1.b") is None
    for missing in ("a.1", "a.x", "a.0.b.c", "", "a..b", "c.d", "a.9999999999"):
        assert at_path(value, missing) is NOTHING
    assert same_value({"x": [1, None]}, {"x": [1.0, None]})
    assert not same_value({"x": 1}, {"x": 1, "y": 2})
    assert not same_value("1", 1)


# pose


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


# classification


def imaged(truth: str | None, answer: str | None, *, spoken: str = "", count: int = 1) -> Recording:
    messages = talk(*[("IMG_DATA::{}", answer)] * count)
    asked = [index for index, message in enumerate(messages) if message.sender == "robot"]
    images = tuple(
        Image(float(t), 30 * t, Pose(100 + 30 * t, 800, 0), b"", b"", index, truth) for t, index in enumerate(asked)
    )
    return recorded(
        background="Simple_Shapes", messages=messages, images=images, spoken=lines(spoken) if spoken else ()
    )


@pytest.mark.parametrize(
    ("answer", "right"),
    [
        ('JSON::{"message": {"shape": "upwards facing triangle"}}', True),
        ('JSON::{"message": {"shape": "Upwards-Facing  TRIANGLE"}}', True),
        ('JSON::{"message": {"shape": "up triangle"}}', True),
        ('JSON::{"message": "I saw an upwards facing triangle"}', True),
        ("It is an upwards facing triangle, I think: upwards facing triangle!", True),
        ('JSON::{"message": {"shape": "diamond"}}', False),
        ("upwards facing triangle or diamond", False),
        ('JSON::{"message": {"shape": "upwards facing triangle", "report": "diamond"}}', True),
        ("upwards facing triangles", False),
        ("triangle", False),
        ('JSON::{"message": {"shape": 4}}', False),
        ("", False),
        (None, False),
    ],
)
def test_what_an_answer_names(answer: str | None, right: bool) -> None:
    asked = criterion("classification", answer="message.shape", aliases={"upwards facing triangle": ["up triangle"]})
    result = judged(asked, imaged("upwards facing triangle", answer))
    assert result.marks == (4 if right else 0), result.message
    assert result.accuracy is not None
    assert result.accuracy.n == 1
    assert [prediction.truth for prediction in result.predictions] == ["upwards facing triangle"]


def test_classification_pools_and_counts_silence_as_wrong() -> None:
    runs = [
        imaged(SQUARE, "square"),
        imaged(SQUARE, "diamond"),
        imaged(DIAMOND, "square or diamond"),
        recorded(background="Simple_Shapes"),
        imaged(None, "square"),
    ]
    result = judged(criterion("classification"), *runs)
    assert result.marks == Decimal("0.80")
    assert result.accuracy is not None
    assert (result.accuracy.value, result.accuracy.n) == (0.2, 5)
    assert {(truth, answer): n for truth, answer, n in result.accuracy.confusion} == {
        (SQUARE, SQUARE): 1,
        (SQUARE, DIAMOND): 1,
        (DIAMOND, None): 1,
        (NO_IMAGE, None): 2,
    }
    assert len(result.predictions) == 3
    assert 'The image showed "square", but it was taken for "diamond".' in result.message
    assert [evidence.passed for evidence in result.evidence] == [True, False, False, False, False]


@pytest.mark.parametrize(("images", "count"), [("all", 3), ("first", 1), ("last", 1)])
def test_which_images_count(images: str, count: int) -> None:
    result = judged(criterion("classification", images=images), imaged(SQUARE, "square", count=3))
    assert len(result.predictions) == count


def test_truth_told_for_each_pose() -> None:
    asked = criterion("classification", truth=["Three", "four"], aliases={"Three": ["3"], "four": ["4"]})
    poses = (START, Pose(200, 800, 0))
    result = judged(asked, imaged(None, "it is a 3"), imaged(None, "3"), poses=poses)
    assert result.marks == 2
    silent = judged(asked, imaged(None, "3"), recorded(background="Simple_Shapes"), poses=poses)
    assert ("four", None, 1) in (silent.accuracy.confusion if silent.accuracy else ())


def test_what_the_robot_says_can_be_the_answer() -> None:
    asked = criterion("classification", answer_from="speech")
    assert judged(asked, imaged(SQUARE, None, spoken="Is that a square")).marks == 4
    assert "said nothing after it" in judged(asked, imaged(SQUARE, "square")).message


@pytest.mark.parametrize(
    ("right", "count", "low", "high"),
    # The score interval of E. B. Wilson (1927), worked out by hand for these counts.
    [(0, 0, 0, 1), (6, 6, 0.6097, 1), (0, 6, 0, 0.3903), (4, 6, 0.3000, 0.9032), (90, 100, 0.8256, 0.9448)],
)
def test_wilson_interval(right: int, count: int, low: float, high: float) -> None:
    assert wilson(right, count) == pytest.approx((low, high), abs=5e-5)


# What students may not see


def test_hidden_trials_are_counted_but_not_told() -> None:
    for asked in (criterion("says", equals="secret"), criterion("classification")):
        result = judged(asked, imaged(SQUARE, "diamond", spoken="no"), recorded(), visibility="hidden")
        assert "scenario s" in result.message  # for staff
        assert result.shown == Shown("Marked in trials that are not shown.")


def test_of_a_criterion_with_hidden_trials_only_the_visible_ones_are_told() -> None:
    asked, wrong = criterion("says", equals="secret"), recorded(spoken=(Line(1.0, "469"),))
    scenarios = (Scenario("s", (START,)), Scenario("t", (START,), visibility="hidden"))
    assignment = Assignment("a", "A", WorldSpec(), Parts(), scenarios, (asked,))
    told = []
    for recording in (wrong, recorded(spoken=(Line(1.0, "secret"),))):
        shown = TrialResult("s", 0, 1, 0, 0, "visible", recorded(spoken=(Line(1.0, "secret"),)))
        (result,) = judge(assignment, (shown, TrialResult("t", 0, 1, 0, 0, "hidden", recording)))
        assert ("469" in result.message) is (recording is wrong)
        told.append(result.shown)
    assert told[0] == told[1]
    assert told[0] is not None
    assert told[0].message.endswith("Trials that are not shown are marked as well.")


def test_trial_that_the_host_spoilt_is_not_marked() -> None:
    with pytest.raises(HostError):
        judged(criterion("finishes"), recorded(verdict=Verdict.HOST_ERROR))


def test_criterion_looks_only_at_its_scenarios() -> None:
    assignment = Assignment(
        "a",
        "A",
        WorldSpec(),
        Parts(),
        (Scenario("s", (START,)), Scenario("t", (START,))),
        (criterion("says", equals="x", scenarios=("t",)),),
    )
    trials = tuple(
        TrialResult(name, 0, 1, 0, 0, "visible", recorded(spoken=lines(text)))
        for name, text in (("s", "y"), ("t", "x"))
    )
    (result,) = judge(assignment, trials)
    assert result.marks == 4
    assert [evidence.trial for evidence in result.evidence] == [1]


# Marks

outcomes = st.lists(
    st.one_of(
        st.just(Outcome(True, Fraction(1), "")),
        st.fractions(0, Fraction(6, 7), max_denominator=7).map(lambda score: Outcome(False, score, "")),
    ),
    min_size=1,
    max_size=12,
)
marks = st.decimals(0, 100, places=2)
overs: st.SearchStrategy[Over] = st.sampled_from(("share", "all", "mean", "median", "worst"))


@given(marks, outcomes, overs)
def test_marks_are_within_bounds_and_full_exactly_for_a_full_share(
    full: Decimal, found: list[Outcome], over: Over
) -> None:
    share = share_of(found, over)
    got = earned(full, share)
    assert 0 <= got <= full
    assert got == got.quantize(Decimal("0.01"))
    if all(outcome.passed for outcome in found):
        assert got == full
    if over in ("all", "worst", "share", "mean") and not all(outcome.passed for outcome in found):
        assert share < 1


@given(marks, outcomes, overs, st.data())
def test_passing_one_more_trial_never_costs_marks(
    full: Decimal, found: list[Outcome], over: Over, data: st.DataObject
) -> None:
    place = data.draw(st.integers(0, len(found) - 1))
    better = [*found]
    better[place] = Outcome(True, Fraction(1), "")
    assert earned(full, share_of(better, over)) >= earned(full, share_of(found, over))


@given(marks, st.integers(0, 60), st.integers(1, 60), st.none() | st.floats(0.01, 1), st.sampled_from(("share", "all")))
def test_a_better_accuracy_never_costs_marks(
    full: Decimal, right: int, count: int, at_least: float | None, over: Over
) -> None:
    right = min(right, count)
    got = earned(full, share_of_accuracy(right, count, at_least, over))
    assert 0 <= got <= full
    assert earned(full, share_of_accuracy(min(right + 1, count), count, at_least, over)) >= got
    if right == count or (at_least is not None and right / count >= at_least + 1e-9):
        assert got == full


@pytest.mark.parametrize(
    ("full", "share", "got"),
    [
        ("1", Fraction(1, 3), "0.33"),
        ("1", Fraction(2, 3), "0.67"),
        ("0.01", Fraction(1, 2), "0.01"),
        ("0.05", Fraction(1, 2), "0.03"),
        ("2.5", Fraction(1, 4), "0.63"),
        ("0.1", Fraction(1, 2), "0.05"),
        ("10000", Fraction(1, 3), "3333.33"),
    ],
)
def test_marks_are_rounded_half_up_once(full: str, share: Fraction, got: str) -> None:
    assert earned(Decimal(full), share) == Decimal(got)


def test_nine_of_ten_is_at_least_nine_tenths() -> None:
    assert share_of_accuracy(9, 10, 0.9, "share") == 1
    assert share_of_accuracy(8, 10, 0.9, "share") == Fraction(8, 9)
    assert share_of_accuracy(8, 10, 0.9, "all") == 0


def test_a_run_of_very_many_messages_is_judged_like_a_short_one() -> None:
    count = 20_000
    messages = talk(*[("PY::1", 'JSON::{"message": 1}')] * count)
    queue = judged(criterion("messages", queue_grows=True), recorded(messages=messages))
    assert queue.message == f"The robot's queue grew by one for each of {count} messages."
    answered = judged(criterion("replies", expect={"PY::1": 1}, path="message"), recorded(messages=messages))
    assert answered.marks == 4


@pytest.mark.parametrize(("found", "expected"), [(10**400, 0.5), (-(10**400), 1.0), (float("inf"), 10**400)])
def test_numbers_beyond_all_fractions_are_compared(found: float, expected: float) -> None:
    assert not same_value(found, expected)
