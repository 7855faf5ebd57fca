"""Recognition judged with recordings made by hand: true labels, outcomes of images, and marks."""

from __future__ import annotations

import re
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as Pixels
from pydantic import ValidationError

import report_builders as build
from judging import START, criterion, judged
from paths import ROOT
from responders.source_file import SourceFile
from service.grading.grade import Accuracy, CriterionResult, TrialResult, VisibleFeedback
from service.grading.grader import grade
from service.grading.judging.geometry import locate_part
from service.grading.judging.judge import judge
from service.grading.judging.label_patches import CODES, decode_label
from service.grading.judging.true_labels import NO_IMAGE
from service.grading.trial_runner import TrialRunner
from service.reports.recognition_table import build_recognition_table, compute_class_scores
from service.reports.view import build_student_view
from sim.floors import SHAPES
from sim.recording import Fault, Image, Message, Pose, Recording, Ticks, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import read_assignment
from submissions.assignment.scenario import Sweep
from submissions.criteria import Criterion
from submissions.criteria.classification import Classification
from submissions.submission import Submission

pytestmark = pytest.mark.fast

HEAD = """
id = "a"
title = "A"
[world]
background = "Simple_Shapes"
labels = {labels}
[[scenario]]
id = "s"
poses = [[200, 900, 0], [280, 900, 0]]
{sweep}
[[criterion]]
title = "Names it"
marks = 4
check = "{check}"
"""


def build_criterion(check: str = "classification", **keys: Any) -> Criterion:
    return criterion(check, **keys)


def recorded(
    images: tuple[Image, ...] = (), messages: tuple[Message, ...] = (), faults: tuple[Fault, ...] = ()
) -> Recording:
    zeros, sums = np.zeros(300), np.zeros((300, 3), dtype=np.int64)
    ticks = Ticks(100 + np.arange(1, 301.0), zeros + 800, zeros, zeros, zeros, sums, sums, zeros, zeros)
    return Recording(
        "Simple_Shapes", START, Pose(400, 800, 0), 10.0, ticks, Verdict.FINISHED, "0" * 64,
        messages=messages, images=images, faults=faults,
    )  # fmt: skip


def talk(*exchanges: tuple[str | None, str | None]) -> Recording:
    """Return images a second and 30 mm apart: their labels, and answers that arrive a tenth of a second later."""
    messages: list[Message] = []
    images = []
    for number, (truth, answer) in enumerate(exchanges):
        t = float(number)
        pose = Pose(100 + 30 * t, 800, 0)
        images.append(Image(t, 30 * number, pose, bytes([number]) * 1600, b"\0" * 1600, len(messages), truth))
        messages.append(Message(t, "robot", "IMG_DATA::{}", t))
        if answer is not None:
            messages.append(Message(t, "responder", answer, t + 0.1, len(messages) - 1))
    return recorded(tuple(images), tuple(messages))


def accuracy(result: CriterionResult) -> Accuracy:
    assert result.accuracy is not None
    return result.accuracy


@pytest.mark.parametrize(
    ("answers", "status", "duplicates"),
    [
        ([("square", 0.1, "")], "answered", 0),
        ([("square", 1.0, "")], "answered", 0),
        ([("square", 1.2, "")], "late", 0),
        ([("square", None, "undelivered")], "late", 0),
        ([("square", None, "lost")], "unanswered", 0),
        ([("JSON::{", 0.1, "malformed")], "malformed", 0),
        ([("JSON::{", 0.1, "malformed"), ("square", 0.2, "")], "answered", 1),
        ([("square", 0.1, ""), ("square", 0.2, "duplicated")], "answered", 1),
        ([("square", None, "lost"), ("square", 0.3, "")], "answered", 0),
        ([("square", 1.3, ""), ("square", 0.3, "duplicated"), ("square", 0.4, "duplicated")], "answered", 2),
        ([], "unanswered", 0),
    ],
)
def test_every_image_has_one_reply_status(
    answers: list[tuple[str, float | None, str]], status: str, duplicates: int
) -> None:
    first = Message(0.0, "robot", "IMG_DATA::{}", 0.0)
    replies = tuple(Message(0.0, "responder", text, t, 0, note) for text, t, note in answers)
    last = len(replies) + 1
    images = (
        Image(0.0, 0, START, b"", b"", 0, "square"),
        Image(1.0, 30, Pose(300, 800, 0), b"", b"", last, None),
    )
    recording = recorded(images, (first, *replies, Message(1.0, "robot", "IMG_DATA::{}", 1.0)))
    counts = accuracy(judged(build_criterion(), recording)).counts
    assert counts is not None
    expected = {"answered": 0, "late": 0, "malformed": 0, "unanswered": 1} | {"sent": 2, "duplicates": duplicates}
    expected[status] += 1
    assert {name: getattr(counts, name) for name in expected} == expected


@pytest.mark.parametrize(
    ("answers", "marks"),
    [
        ([("circle", 0.4, ""), ("square", 0.2, "")], 4),
        ([("square", 0.4, ""), ("circle", 0.2, "")], 0),
        ([("circle", 1.4, ""), ("square", 0.2, "")], 4),
        ([("circle", 1.4, ""), ("square", 1.2, "")], 4),
        ([("circle", None, "undelivered"), ("square", 1.2, "")], 4),
        ([("circle", 0.2, ""), ("square", 0.2, "")], 0),
    ],
)
def test_of_several_answers_the_first_that_arrived_counts(
    answers: list[tuple[str, float | None, str]], marks: int
) -> None:
    recording = talk(("square", None), (None, None))
    sent, following = recording.messages
    replies = tuple(Message(0.0, "responder", text, t, 0, note) for text, t, note in answers)
    moved = replace(recording.images[1], message=len(replies) + 1)
    recording = replace(recording, messages=(sent, *replies, following), images=(recording.images[0], moved))
    assert judged(build_criterion(), recording).marks == marks


def test_an_answer_that_is_no_text_is_malformed() -> None:
    fault = Fault(0.0, Verdict.PROTOCOL_ERROR, "responder", "the responder returned dict instead of a text")
    recording = replace(talk(("square", None)), faults=(fault,))
    result = judged(build_criterion(), recording)
    counts = accuracy(result).counts
    assert counts is not None
    assert (counts.malformed, counts.unanswered) == (1, 0)
    assert "returned dict instead of a text" in result.message


def test_a_late_answer_counts_unless_the_criterion_says_otherwise() -> None:
    late = talk(("square", "square"))
    late = replace(late, messages=(late.messages[0], replace(late.messages[1], delivered=None, note="undelivered")))
    assert judged(build_criterion(), late).marks == 4
    refused = judged(build_criterion(late="wrong"), late)
    assert refused.marks == 0
    assert 'the answer came too late: "square"' in refused.message
    assert "0 answered, 1 late, 0 malformed, 0 unanswered" in refused.message


_TEXTS = st.sampled_from(["square", "diamond", "JSON::{", 'JSON::{"shape": "square"}', "square or diamond", "?"])
_TIMES = st.none() | st.floats(0, 12)
_REPLIES = st.lists(
    st.tuples(_TEXTS, _TIMES, st.sampled_from(["", "lost", "duplicated", "malformed", "undelivered"])), max_size=4
)
_IMAGES = st.lists(
    st.tuples(st.floats(0, 2), st.sampled_from([None, "square", "diamond"]), _REPLIES, st.booleans()), max_size=7
)


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    """Draw any conversation about images, in any order of arrival, with faults at any time."""
    messages: list[Message] = []
    images = []
    t = 0.0
    for wait, truth, replies, lost in draw(_IMAGES):
        t += wait
        images.append(Image(t, int(30 * t), Pose(100 + 10 * t, 800, 0), b"", b"", len(messages), truth))
        asked_at = len(messages)
        messages.append(Message(t, "robot", "IMG_DATA::{}", None if lost else t, note="lost" if lost else ""))
        messages += [Message(t, "responder", text, at, asked_at, note) for text, at, note in replies]
    times = draw(st.lists(st.floats(0, 12), max_size=3))
    faults = tuple(
        Fault(at, Verdict.PROTOCOL_ERROR, "responder", "the responder returned int instead of a text") for at in times
    )
    return recorded(tuple(images), tuple(messages), faults)


@given(
    st.lists(recordings(), min_size=1, max_size=3),
    st.sampled_from(
        [{}, {"images": "last"}, {"late": "wrong"}, {"each_pattern": "majority", "patterns": 2}, {"answer": "shape"}]
    ),
)
def test_the_counts_add_up(driven: list[Recording], keys: dict[str, Any]) -> None:
    result = judged(build_criterion(**keys), *driven)
    measured_accuracy = accuracy(result)
    counts = measured_accuracy.counts
    assert counts is not None
    assert counts.sent == sum(len(recording.images) for recording in driven)
    assert counts.sent == counts.answered + counts.late + counts.malformed + counts.unanswered
    assert (
        measured_accuracy.n
        == counts.counted + counts.missing
        == sum(number for _, _, number in measured_accuracy.confusion)
    )
    assert counts.missing == sum(number for truth, _, number in measured_accuracy.confusion if truth == NO_IMAGE)
    assert sum(score.shown for score in compute_class_scores(measured_accuracy)) == measured_accuracy.n
    assert 0 <= measured_accuracy.low <= measured_accuracy.value <= measured_accuracy.high <= 1
    numbers = [int(word) for word in build_recognition_table(result).sums.split() if word.isdecimal()]
    assert numbers[0] == sum(numbers[1:5])


def test_the_grey_patch_can_be_the_truth() -> None:
    def patch(grey: int, edge: int = 0) -> bytes:
        pixels = np.full((20, 20, 4), 255, np.uint8)
        pixels[:, edge:, :3] = grey
        return pixels.tobytes()

    greys = (0, 42, 85, 127, 170, 212)
    images = [Image(0, 0, START, b"", patch(grey), 0) for grey in greys]
    assert [decode_label(image, CODES["shapes"]) for image in images] == list(SHAPES)
    for useless in (patch(60), patch(85, edge=5), patch(255)):
        assert decode_label(replace(images[0], right=useless), CODES["shapes"]) is None
    chance = np.random.default_rng(1)
    noisy = np.frombuffer(patch(127), np.uint8).astype(int) + chance.integers(-32, 33, 1600)
    image = replace(images[0], right=noisy.clip(0, 255).astype(np.uint8).tobytes())
    assert decode_label(image, CODES["shapes"], light_noise=32) == "downwards facing triangle"
    assert decode_label(image, CODES["shapes"]) is None
    recording = talk((None, "left facing triangle"), (None, "square"))
    seen = tuple(replace(image, right=patch(85)) for image in recording.images)
    assert judged(build_criterion(truth="grey"), replace(recording, images=seen)).marks == 2


GREY_WORLD = """
id = "own"
title = "Own image"
[world]
background = "mine.png"
[parts]
responder = "plain.py"
[[scenario]]
id = "s"
poses = [[300, 500, 0], [600, 500, 0], [900, 500, 0]]
seconds = 3
[[criterion]]
title = "Names it"
marks = 3
check = "classification"
truth = "grey"
"""


def test_the_grey_patch_can_be_the_truth_on_an_image_of_the_instructors_own(
    tmp_path: Path, runner: TrialRunner
) -> None:
    """The right sensor of a robot at (300, 500) that faces 0 degrees is at (330, 480)."""
    pixels = np.full((1143, 2362, 3), 255, np.uint8)
    for x, grey in ((330, 42), (630, 190), (930, 100)):
        pixels[1143 - 480 - 30 : 1143 - 480 + 30, x - 30 : x + 30] = grey
    Pixels.fromarray(pixels).save(tmp_path / "mine.png")
    (tmp_path / "plain.py").write_text("def responder(text):\n    return 'a church'\n")
    file = tmp_path / "assignment.toml"
    file.write_text(GREY_WORLD)
    with pytest.raises(AssignmentProblems, match=r'has no labels, expected greys = "shapes", "digits" or'):
        read_assignment(tmp_path)
    file.write_text(GREY_WORLD + "greys = { church = 42, mill = 190 }\n")
    program = Submission("ada", SourceFile("robot.py", "import time\nprint('IMG_DATA')\ntime.sleep(0.5)\n"))
    result = grade(program, read_assignment(tmp_path), runner=runner).criteria[0]
    # A grey of no label shows nothing to recognise. A trial without an image that counts is a wrong answer.
    assert result.message.startswith("1 of 3 images identified correctly")
    assert accuracy(result).confusion == ((NO_IMAGE, None, 1), ("church", "church", 1), ("mill", "church", 1))
    file.write_text(GREY_WORLD + 'greys = "shapes"\n')
    shapes = grade(program, read_assignment(tmp_path), runner=runner).criteria[0]
    assert accuracy(shapes).confusion[0][0] == NO_IMAGE
    assert {truth for truth, *_ in accuracy(shapes).confusion} == {NO_IMAGE, SHAPES[1]}


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"greys": "shapes"}, "has greys without truth"),
        ({"truth": "grey", "greys": {"a": 10, "b": 14}}, "too similar"),
        ({"truth": "grey", "greys": {"a": 256}}, "less than or equal to 255"),
        ({"truth": "grey", "greys": "letters"}, "Input should be 'shapes' or 'digits'"),
    ],
)
def test_greys_that_cannot_be_used_are_refused(keys: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        build_criterion(**keys)


def test_the_instructors_places_can_be_the_truth() -> None:
    # The left sensor of a robot at (100, 800) that faces 0 degrees is at (130, 820).
    places = [[130, 820, "church"], [160, 828, "mill"], [400, 400, "inn"]]
    recording = talk((None, "a church"), (None, "the mill"), (None, "church"))
    assert judged(build_criterion(truth="places", places=places), recording).message.startswith(
        "2 of 2 images identified correctly"
    )
    near = judged(build_criterion(truth="places", places=places, within=5), recording)
    assert near.message.startswith("1 of 1 images")


def test_places_are_read_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "assignment.toml").write_text(
        HEAD.format(labels="true", sweep="", check="classification") + 'truth = "places"\nplaces = "places.csv"\n'
    )
    (tmp_path / "places.csv").write_text("x,y,label\n230, 920 ,church\n\n310,920,mill\n")
    (criterion,) = read_assignment(tmp_path).criteria
    assert isinstance(criterion, Classification)
    assert criterion.places == ((230.0, 920.0, "church"), (310.0, 920.0, "mill"))
    (tmp_path / "places.csv").write_text("230,920,church\n310,north,mill\n")
    with pytest.raises(
        AssignmentProblems, match=r"assignment\.toml:16: places\.csv:2: '310,north,mill' is not a place"
    ):
        read_assignment(tmp_path)


@pytest.mark.parametrize(
    ("labels", "sweep", "check", "keys", "sentence"),
    [
        ("true", "", "classification", 'truth = "places"', "needs truth = \"places\" and places together"),
        ("true", "", "classification", 'truth = "places"\nplaces = "x.csv"', "expected a CSV file of x, y, label"),
        ("false", "", "classification", 'truth = "grey"', "the world has labels = false"),
        ("true", "", "classification", 'truth = "gray"', "neither \"label\", \"grey\" or \"places\" nor a list"),
        ("true", "", "classification", "steps = [[0.9, 4], [0.5, 2]]", "steps that do not ascend"),
        ("true", "", "classification", "steps = [[0.5, 2], [0.9, 3]]", "a last step of 3 marks, expected 4"),
        ("true", "", "classification", "steps = [[0.5, 4]]\nat_least = 0.5", "has steps beside at_least"),
        ("true", "", "classification", "patterns = 3", "has patterns without each_pattern"),
        ("true", "", "classification", 'answer_from = "print"\nlate = "wrong"', "has confidence or late beside"),
        ("true", "", "robustness", 'along = "offset_x"', "no scenario of the criterion is swept over it"),
        ("true", "sweep = {loss = [0, 2]}", "classification", "", "has 2 in it, expected numbers from 0 to 1"),
        ("true", "sweep = {delay = [1, 1]}", "classification", "", "has a level twice"),
        ("true", "sweep = {tilt = [1]}", "classification", "", '"tilt" is not a key of this table'),
        ("true", "start_jitter = [1, 2]", "classification", "", "[mm in x, mm in y, degrees]"),
        (
            "true",
            "sweep = {offset_x = [0, 1]}",
            "robustness",
            'along = "offset_x"\nmarks_from = "falls_below"',
            "needs level with marks_from",
        ),
        ("true", "trials = 1000\nsweep = {loss = [0, 0.5, 1]}", "classification", "", "too many trials"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_their_line(
    tmp_path: Path, labels: str, sweep: str, check: str, keys: str, sentence: str
) -> None:
    (tmp_path / "assignment.toml").write_text(HEAD.format(labels=labels, sweep=sweep, check=check) + keys)
    with pytest.raises(AssignmentProblems) as raised:
        read_assignment(tmp_path)
    assert sentence in str(raised.value)


def test_the_assignment_in_the_document_is_in_order(tmp_path: Path) -> None:
    document = (ROOT / "docs" / "recognition.md").read_text()
    robustness_example, training = re.findall(r"```toml\n(.*?)```", document, re.DOTALL)
    (tmp_path / "assignment.toml").write_text(robustness_example)
    assignment = read_assignment(tmp_path)
    assert len(list(assignment.trials())) == 70
    (tmp_path / "assignment.toml").write_text(
        f"{robustness_example}\n{training}".replace('"collected"', '"worse-and-worse"')
    )
    (tmp_path / "drive_over_shapes.py").write_text("")
    with pytest.raises(
        AssignmentProblems,
        match="scenarios names every scenario, expected at least one scenario without training images",
    ):
        read_assignment(tmp_path)


def test_confidence_is_averaged_apart_for_right_and_wrong() -> None:
    format_answer = 'JSON::{{"shape": "{}", "confidence": {}}}'.format
    recording = talk(
        ("square", format_answer("square", 0.9)),
        ("square", format_answer("square", 0.7)),
        ("diamond", format_answer("square", 0.4)),
        ("diamond", format_answer("diamond", 7)),
        ("diamond", format_answer("diamond", "true")),
    )
    result = judged(build_criterion(answer="shape", confidence="confidence"), recording)
    confidence = accuracy(result).confidence
    assert confidence is not None
    assert (confidence.right, confidence.n_right) == (pytest.approx(0.8), 2)
    assert (confidence.wrong, confidence.n_wrong) == (pytest.approx(0.4), 1)
    assert "Mean confidence 0.80 when right (2) and 0.40 when wrong (1)." in result.message
    assert accuracy(judged(build_criterion(answer="shape"), recording)).confidence is None


@pytest.mark.parametrize(
    ("reply", "is_right"),
    [
        ('JSON::{"message": {"shape": "square"}}', True),
        ('JSON::{"message": {"shape": "square", "report": "diamond or square"}}', True),
        ('JSON::{"message": {"form": "square"}}', False),
        ('JSON::{"shape": "square"}', False),
        ('JSON::{"message": {"shape": ["square"]}}', False),
        ('JSON::{"message": {"shape": {"name": "square"}}}', False),
        ('{"message": {"shape": "square"}}', False),
        ("square", False),
    ],
)
def test_an_answer_must_be_at_its_place_in_the_json(reply: str, is_right: bool) -> None:
    result = judged(build_criterion(answer="message.shape"), talk(("square", reply)))
    assert result.evidence[0].passed == is_right
    assert ("the answer has no text or number at message.shape" in result.message) == (not is_right)


@pytest.mark.parametrize(("right", "marks"), [(0, "0"), (4, "0"), (5, "2"), (8, "2"), (9, "4"), (10, "4")])
def test_marks_by_steps(right: int, marks: str) -> None:
    answers = [("square", "square" if number < right else "diamond") for number in range(10)]
    result = judged(build_criterion(steps=[[0.5, 2], [0.9, 4]]), talk(*answers))
    assert result.marks == Decimal(marks)
    assert ("Marks: 2 from 0.5, 4 from 0.9." in result.message) is (result.marks < 4)


@pytest.mark.parametrize(
    ("how", "answers", "named"),
    [
        ("first", ["diamond", "square", "square"], False),
        ("any", ["diamond", "square", None], True),
        ("any", ["diamond", None], False),
        ("majority", ["diamond", "square", "square"], True),
        ("majority", [None, None, "square"], True),
        ("majority", ["diamond", "square"], False),
        ("majority", [None, None], False),
    ],
)
def test_images_of_one_pattern_are_one_answer(how: str, answers: list[str | None], named: bool) -> None:
    recording = talk(*[("square", answer) for answer in answers])
    close = tuple(replace(image, pose=Pose(100 + n, 800, 0)) for n, image in enumerate(recording.images))
    result = judged(build_criterion(each_pattern=how), replace(recording, images=close))
    assert (accuracy(result).n, result.marks) == (1, 4 if named else 0), result.message
    assert len(result.predictions) == len(answers)
    assert "patterns identified correctly" in result.message


def test_patterns_are_told_apart_by_place_and_missing_ones_are_wrong() -> None:
    # 30 mm apart: the images before the gap show one square, those after it another.
    recording = talk(("square", "square"), ("square", "square"), (None, "square"), ("square", "square"))
    assert accuracy(judged(build_criterion(each_pattern="first"), recording)).n == 2
    result = judged(build_criterion(each_pattern="first", patterns=4), recording)
    assert (accuracy(result).n, result.marks) == (4, 2)
    assert "images of 2 patterns, and 4 were expected" in result.message


def test_images_taken_elsewhere_do_not_count_near_the_start() -> None:
    """A robot may not drive on to an image that is easier to recognise."""
    moved = talk(("square", None), ("diamond", None), ("circle", "circle"))
    stayed = talk(("square", None), ("circle", "circle"))
    assert judged(build_criterion(images="last"), moved).marks == 4
    for recording in (moved, stayed):
        result = judged(build_criterion(images="last", near_start=20), recording)
        assert result.marks == 0
        assert 'The image showed "square"' in result.message
    left = judged(build_criterion(near_start=20), replace(moved, images=moved.images[1:]))
    assert (left.marks, accuracy(left).n) == (0, 1)
    assert "the robot sent none from within 20 mm of where it started" in left.message


def test_more_images_near_the_start_do_not_weigh_more() -> None:
    """A robot that is sure of its answer may not raise the accuracy by sending many images from places nearby."""
    sure = talk(*[("square", "square")] * 9)
    walked = tuple(replace(image, pose=Pose(100 + 1.5 * n, 800, 0)) for n, image in enumerate(sure.images))
    unsure = talk(("diamond", "square"))
    result = judged(build_criterion(near_start=30), replace(sure, images=walked), unsure)
    assert (accuracy(result).n, result.marks) == (2, 2), result.message


def test_precision_and_recall_of_each_class() -> None:
    label_pairs = [("square", "square"), ("square", "diamond"), ("diamond", "diamond"), ("diamond", None)]
    scores = {
        score.label: score for score in compute_class_scores(accuracy(judged(build_criterion(), talk(*label_pairs))))
    }
    assert (scores["square"].precision, scores["square"].recall) == (1.0, 0.5)
    assert (scores["diamond"].precision, scores["diamond"].recall) == (0.5, 0.5)
    assert (scores["upwards facing triangle"].precision, scores["upwards facing triangle"].recall) == (None, None)


def test_the_levels_of_a_hidden_sweep_are_not_told() -> None:
    scenario = Scenario("s", (START,), sweep=Sweep(light_noise=(0, 64)))
    criterion = build_criterion("robustness", along="light_noise")
    assignment = Assignment("a", "A", WorldSpec("Simple_Shapes"), Parts(), (scenario,), (criterion,))
    for visibility in ("visible", "hidden"):
        trials = tuple(
            TrialResult("s", n, 1, 64.0 * n, 0.0, visibility, talk(("square", "square")), (("light_noise", 64.0 * n),))
            for n in range(2)
        )
        (result,) = judge(assignment, trials)
        assert result.marks == 4
        assert "64" in result.message
        assert result.shown == (
            None if visibility == "visible" else VisibleFeedback("Marked in trials that are not shown.")
        )


def test_a_student_sees_no_curve_of_hidden_trials() -> None:
    grade = build.swept_grade()
    assert build_student_view(grade).grade.criteria[0].curves
    hidden = replace(grade, trials=(*grade.trials[:-1], replace(grade.trials[-1], visibility="hidden")))
    assert not build_student_view(hidden).grade.criteria[0].curves


def test_images_taken_far_from_what_they_show_do_not_count() -> None:
    recording = talk(("square", "square"), ("square", "circle"))
    first, second = recording.images
    x, y = locate_part(recording, "left", first.pose)
    recording = replace(recording, images=(first, replace(second, pose=replace(first.pose, x=first.pose.x + 8))))
    keys: dict[str, Any] = {"truth": "places", "places": [[x, y, "square"]]}
    assert judged(build_criterion(**keys), recording).marks < 4
    assert judged(build_criterion(near_spot=5, **keys), recording).marks == 4
