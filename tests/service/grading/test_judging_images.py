"""Judging the labels of images, with recordings made by hand, and messages to students about hidden trials."""

from __future__ import annotations

from decimal import Decimal

import pytest

from judging import START, criterion, judged, lines, recorded, talk
from models.intervals import compute_wilson_interval
from service.grading.grade import TrialResult, VisibleFeedback
from service.grading.judging.judge import judge
from service.grading.judging.true_labels import NO_IMAGE
from sim.errors import HostError
from sim.recording import Image, Pose, Recording, TimedText, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec

pytestmark = pytest.mark.fast

SQUARE, DIAMOND = "square", "diamond"


def imaged(truth: str | None, answer: str | None, *, spoken: str = "", count: int = 1) -> Recording:
    messages = talk(*[("IMG_DATA::{}", answer)] * count)
    robot_indices = [index for index, message in enumerate(messages) if message.sender == "robot"]
    images = tuple(
        Image(float(t), 30 * t, Pose(100 + 30 * t, 800, 0), b"", b"", index, truth)
        for t, index in enumerate(robot_indices)
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
        ('JSON::{"message": "I saw an upwards facing triangle"}', False),
        ("It is an upwards facing triangle, I think: upwards facing triangle!", False),
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
    rule = criterion("classification", answer="message.shape", aliases={"upwards facing triangle": ["up triangle"]})
    result = judged(rule, imaged("upwards facing triangle", answer))
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
    assert 'The image showed "square", but it was identified as "diamond".' in result.message
    assert [evidence.passed for evidence in result.evidence] == [True, False, False, False, False]


@pytest.mark.parametrize(("images", "count"), [("all", 3), ("first", 1), ("last", 1)])
def test_which_images_count(images: str, count: int) -> None:
    result = judged(criterion("classification", images=images), imaged(SQUARE, "square", count=3))
    assert len(result.predictions) == count


def test_truth_told_for_each_pose() -> None:
    rule = criterion("classification", truth=["Three", "four"], aliases={"Three": ["3"], "four": ["4"]})
    poses = (START, Pose(200, 800, 0))
    result = judged(rule, imaged(None, "it is a 3"), imaged(None, "3"), poses=poses)
    assert result.marks == 2
    silent = judged(rule, imaged(None, "3"), recorded(background="Simple_Shapes"), poses=poses)
    assert ("four", None, 1) in (silent.accuracy.confusion if silent.accuracy else ())


def test_what_the_robot_says_can_be_the_answer() -> None:
    rule = criterion("classification", answer_from="speech")
    assert judged(rule, imaged(SQUARE, None, spoken="Is that a square")).marks == 4
    assert "said nothing after the image" in judged(rule, imaged(SQUARE, "square")).message


@pytest.mark.parametrize(
    ("right", "count", "low", "high"),
    # The score interval of E. B. Wilson (1927), calculated by hand for these counts.
    [(0, 0, 0, 1), (6, 6, 0.6097, 1), (0, 6, 0, 0.3903), (4, 6, 0.3000, 0.9032), (90, 100, 0.8256, 0.9448)],
)
def test_wilson_interval(right: int, count: int, low: float, high: float) -> None:
    assert compute_wilson_interval(right, count) == pytest.approx((low, high), abs=5e-5)


def test_hidden_trials_are_counted_but_not_told() -> None:
    for each in (criterion("says", equals="secret"), criterion("classification")):
        result = judged(each, imaged(SQUARE, "diamond", spoken="no"), recorded(), visibility="hidden")
        assert "scenario s" in result.message  # for staff
        assert result.shown == VisibleFeedback("Marked in trials that are not shown.")


def test_of_a_criterion_with_hidden_trials_only_the_visible_ones_are_told() -> None:
    rule, wrong = criterion("says", equals="secret"), recorded(spoken=(TimedText(1.0, "469"),))
    scenarios = (Scenario("s", (START,)), Scenario("t", (START,), visibility="hidden"))
    assignment = Assignment("a", "A", WorldSpec(), Parts(), scenarios, (rule,))
    messages = []
    for recording in (wrong, recorded(spoken=(TimedText(1.0, "secret"),))):
        speech = TrialResult("s", 0, 1, 0, 0, "visible", recorded(spoken=(TimedText(1.0, "secret"),)))
        (result,) = judge(assignment, (speech, TrialResult("t", 0, 1, 0, 0, "hidden", recording)))
        assert ("469" in result.message) is (recording is wrong)
        messages.append(result.shown)
    assert messages[0] == messages[1]
    assert messages[0] is not None
    assert messages[0].message.endswith("Trials that are not shown are marked as well.")


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
