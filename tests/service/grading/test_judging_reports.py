"""Judging reports, ordered speech, stops on events, and logs, with recordings made by hand."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from driving import driven, rest, spin, straight
from judging import START, criterion, judged
from service.grading.grade import TrialResult
from service.grading.judging.judge import judge
from service.grading.judging.text_tokens import split_words, tokenize_text
from sim.floors import build_floor
from sim.recording import DatalogEntry, Fault, Message, Pose, Recording, Ticks, TimedText, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec

pytestmark = pytest.mark.fast


def recorded(seconds: float = 3.0, rgb: Sequence[int] = (255, 255, 255), **parts: Any) -> Recording:
    """Return a run along x at 30 mm/s, with the left sensor over ``rgb`` and the right one over white."""
    count = round(seconds * 30)
    zeros = np.zeros(count)
    sums = np.tile(np.array(rgb, np.int64) * 305, (count, 1))
    white = np.full((count, 3), 255 * 305, np.int64)
    x = 100 + np.arange(1, count + 1.0)
    end = Pose(100 + count, 800, 0)
    values: dict[str, Any] = {
        "background": "Empty_Map",
        "start": START,
        "end": end,
        "end_t": seconds,
        "ticks": Ticks(x, zeros + 800, zeros, zeros, zeros, sums, white, zeros, zeros),
        "verdict": Verdict.FINISHED,
        "sha256": "0" * 64,
    }
    return Recording(**(values | parts))


def lines(*texts: str, every: float = 1.0) -> tuple[TimedText, ...]:
    return tuple(TimedText(place * every, text) for place, text in enumerate(texts))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("T M 1 2 9", ["t", "m", "1", "2", "9"]),
        ("TM129!", ["tm129"]),
        ("Tee, em; ONE-two", ["tee", "em", "1", "2"]),
        ("one hundred and ninety", ["100", "and", "90"]),
        ("", []),
    ],
)
def test_words_without_case_and_punctuation(text: str, words: list[str]) -> None:
    assert split_words(text) == words


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("Light: 86.27%", [86.27]),
        ("[211, 211,211]", [211, 211, 211]),
        ("-3 and +4.5, 1e3", [-3, 4.5, 1000]),
        ("v2 a1b 2nd", []),
        ("x=.5", [0.5]),
        ("ten", [10]),
        ("82.", [82]),
        ("1e999999", []),
    ],
)
def test_numbers_as_python_writes_them(text: str, values: list[float]) -> None:
    assert [token.value for token in tokenize_text(text) if token.value is not None] == values


@pytest.mark.parametrize(
    ("keys", "printed", "passes"),
    [
        ({"expected": [[86.27]]}, ["Light: 86.2745"], True),
        ({"expected": [[86.27]]}, ["Light: 85.7"], False),
        ({"expected": [[86.27]], "tolerance": 1}, ["Light: 85.7"], True),
        ({"expected": [[5, "Red"]]}, ["5 red"], True),
        ({"expected": [[5, "Red"]]}, ["Red 5"], False),
        ({"expected": [[5, "Red"]]}, ["5", "it is Red!"], True),
        ({"expected": [["dark grey"]], "among": ["dark grey", "black"]}, ["dark  GREY"], True),
        ({"expected": [["dark grey"]], "among": ["dark grey", "black"]}, ["dark grey or black"], False),
        ({"expected": [["dark"]], "among": ["dark", "light"]}, ["darker"], False),
        ({"expected": [[3]], "only": True}, ["3"], True),
        ({"expected": [[3]], "only": True}, ["1 2 3 4"], False),
        ({"expected": [[3]]}, [], False),
    ],
)
def test_reported_figures(keys: dict[str, Any], printed: list[str], passes: bool) -> None:
    result = judged(criterion("reports", **keys), recorded(printed=lines(*printed)))
    assert result.marks == (4 if passes else 0), result.message


def test_each_pose_has_its_own_figures() -> None:
    rule = criterion("reports", expected=[[100], [50]])
    poses = (START, Pose(200, 800, 0))
    right = [recorded(printed=lines("100")), recorded(printed=lines("50"))]
    assert judged(rule, *right, poses=poses).marks == 4
    assert judged(rule, *reversed(right), poses=poses).marks == 0


def test_what_say_prints_as_well_is_reported_once() -> None:
    spoken_texts = lines("3", "4")
    assert (
        judged(criterion("reports", expected=[[3, 4]]), recorded(printed=spoken_texts, spoken=spoken_texts)).marks == 4
    )
    assert (
        judged(criterion("reports", expected=[[3, 4, 3]]), recorded(printed=spoken_texts, spoken=spoken_texts)).marks
        == 0
    )


def test_replies_are_looked_at_whether_they_arrived_or_not() -> None:
    talk = (Message(0, "robot", "IMG_DATA::{}", 0), Message(0, "responder", '{"rows": 7}', None, 0, "undelivered"))
    rule = criterion("reports", source="reply", expected=[["rows", 7]])
    assert judged(rule, recorded(messages=talk)).marks == 4
    assert "did not answer anything" in judged(rule, recorded()).message


def test_label_of_the_floor_is_what_has_to_be_reported() -> None:
    start = Pose(600, 750, 90)
    label = build_floor("MNIST_Digits", seed=34).find_label(580, 780)
    rule = criterion("reports", expected="label", only=True)
    recording = recorded(background="MNIST_Digits", sheet=34, start=start, printed=lines(f"Label: {label}"))
    assert judged(rule, recording, poses=(start,)).marks == 4
    wrong = replace(recording, printed=lines(f"Label: {(int(label or 0) + 1) % 10}"))
    assert judged(rule, wrong, poses=(start,)).marks == 0


@pytest.mark.parametrize(
    ("keys", "spoken_texts", "marks"),
    [
        ({}, ["1", "2", "3"], 4),
        ({}, ["one two", "three"], 4),
        ({}, ["1 2 3 4"], 0),
        ({"more": True}, ["1 2 3 4"], 4),
        ({}, ["I count 1 2 3"], 0),
        ({"lead_in": True}, ["I count one", "1 2 3"], 4),
        ({"lead_in": True}, ["1 2", "and 3"], 0),
        ({}, ["123"], 0),
        ({"over": "mean"}, ["1", "2"], Decimal("2.67")),
        ({}, [], 0),
    ],
)
def test_words_in_sequence(keys: dict[str, Any], spoken_texts: list[str], marks: Decimal) -> None:
    result = judged(criterion("sequence", words=["1", "2", "3"], **keys), recorded(spoken=lines(*spoken_texts)))
    assert result.marks == marks, result.message


def test_a_word_may_be_any_of_a_list() -> None:
    rule = criterion("sequence", words=[["T", "tee"], ["M", "em"]])
    assert judged(rule, recorded(spoken=lines("Tee em"))).marks == 4
    assert judged(rule, recorded(spoken=lines("TM"))).marks == 0


@pytest.mark.parametrize(
    ("words", "keys", "spoken_text", "passes"),
    [
        # The first matching alternative may be the prefix of the intended one.
        ([["OK", "OK go"], "now"], {}, "OK go now", True),
        ([["OK", "OK go"], "now"], {}, "OK now", True),
        ([["OK", "OK go"], ["go now", "now"], "now"], {}, "OK go now", False),
        ([["OK", "OK go"], ["go now", "now"], "now"], {}, "OK go go now now", True),
        # An earlier run is equally long, but only the later one is at the end.
        (["1", "2"], {"lead_in": True}, "1 2 and 1 2", True),
        (["1", ["2", "2 3"]], {}, "1 2 3", True),
        (["1", ["2 3", "2"]], {"more": True}, "1 2 3", True),
    ],
)
def test_every_alternative_is_tried(words: list[Any], keys: dict[str, Any], spoken_text: str, passes: bool) -> None:
    result = judged(criterion("sequence", words=words, **keys), recorded(spoken=lines(spoken_text)))
    assert result.evidence[0].passed is passes, result.message


short = st.lists(st.sampled_from("ab"), min_size=1, max_size=2).map(" ".join)


@given(
    st.lists(st.lists(short, min_size=1, max_size=2, unique=True), min_size=1, max_size=3),
    st.lists(st.sampled_from("ab"), min_size=1, max_size=6),
    st.booleans(),
    st.booleans(),
)
def test_a_sequence_is_found_wherever_an_exhaustive_search_finds_it(
    wanted: list[list[str]], spoken_texts: list[str], lead_in: bool, more: bool
) -> None:
    rule = criterion("sequence", words=wanted, lead_in=lead_in, more=more, strays=100)
    starts = range(len(spoken_texts)) if lead_in else range(1)
    begins = [spoken_texts[start:] for start in starts]

    def fits(chosen: Sequence[str]) -> bool:
        words = " ".join(chosen).split()
        return any(begin[: len(words)] == words and (more or begin == words) for begin in begins)

    result = judged(rule, recorded(spoken=lines(" ".join(spoken_texts))))
    assert result.evidence[0].passed is any(fits(chosen) for chosen in itertools.product(*wanted)), result.message


def test_nothing_is_said_before_the_word_before_has_been_spoken() -> None:
    rule = criterion("sequence", words=["1", "2"], waits=True)
    assert judged(rule, recorded(spoken=lines("1", "2", every=0.47))).marks == 4
    hurried = judged(rule, recorded(spoken=lines("1", "2", every=0.44)))
    assert hurried.marks == 0
    assert "while it was still speaking" in hurried.message


BANDS = [{"text": "1", "zone": [120, 700, 140, 900]}, {"text": ["2", "two"], "zone": [160, 700, 180, 900]}]


@pytest.mark.parametrize(
    ("times", "marks"),
    # The left sensor is 30 mm ahead and moves at 30 mm/s from x = 130.
    [((0.1, 1.2), 4), ((0.1, 0.9), 2), ((1.2, 0.1), 0), ((0.1, 2.0), 2), ((0.1,), 2)],
)
def test_each_event_happens_at_its_place(times: tuple[float, ...], marks: int) -> None:
    speech = tuple(TimedText(t, text) for t, text in zip(times, ("band 1", "band two"), strict=False))
    result = judged(criterion("events", events=BANDS, over="mean"), recorded(spoken=speech))
    assert result.marks == marks, result.message


def test_margin_widens_every_zone() -> None:
    speech = (TimedText(0.1, "1"), TimedText(2.0, "2"))
    assert judged(criterion("events", events=BANDS, margin=15), recorded(spoken=speech)).marks == 4


@pytest.mark.parametrize(
    ("keys", "passes"),
    [
        ({"reflected": [0, 5]}, True),
        ({"reflected": [5, 100]}, False),
        ({"rgb": [0, 0, 0]}, True),
        ({"rgb": [255, 0, 0]}, False),
        ({"sensor": "right", "reflected": [100, 100]}, True),
        ({"sensor": "either", "reflected": [100, 100]}, True),
        # The left sensor ends 30 mm ahead of (190, 800) and 20 mm to the left.
        ({"near": [220, 820], "within": 1}, True),
        ({"near": [220, 780], "within": 1}, False),
        ({"zone": [215, 815, 225, 825]}, True),
        ({"zone": [180, 790, 200, 810]}, False),
        ({"reflected": [0, 5], "still": 0.5}, False),
    ],
)
def test_what_the_sensor_stops_on(keys: dict[str, Any], passes: bool) -> None:
    result = judged(criterion("stop_on", **keys), recorded(rgb=(0, 0, 0)))
    assert result.marks == (4 if passes else 0), result.message


@pytest.mark.parametrize(
    ("moves", "still", "passes"),
    [
        ((straight(100), rest(30)), 1, True),
        ((straight(100), rest(29)), 1, False),
        ((rest(30),), 1, True),
        ((rest(29),), 1, False),
        ((straight(100), rest(4), spin(360)), 0.1, False),
        ((straight(100), rest(4), spin(-360, 0.5)), 0.1, False),
        ((straight(100), spin(90), rest(3)), 0.1, True),
    ],
)
def test_a_robot_that_stands_neither_drives_nor_turns(moves: Any, still: float, passes: bool) -> None:
    result = judged(criterion("stop_on", reflected=[99, 100], off_floor=True, still=still), driven(*moves))
    assert result.evidence[0].passed is passes, result.message


@pytest.mark.parametrize(("verdict", "marks"), [(Verdict.TIME_LIMIT, 0), (Verdict.PROGRAM_ERROR, 4)])
def test_a_program_that_is_still_running_has_not_stopped(verdict: Verdict, marks: int) -> None:
    cut = recorded(rgb=(0, 0, 0), verdict=verdict, faults=(Fault(3.0, verdict, "program", "x", 7),))
    assert judged(criterion("stop_on", reflected=[0, 5]), cut).marks == marks


def test_a_robot_without_a_tick_has_not_stopped_on_anything() -> None:
    assert judged(criterion("stop_on", reflected=[0, 5]), recorded(seconds=0, rgb=(0, 0, 0))).marks == 0


def series(*values: float, name: str = "Light_left", timed: bool = True) -> tuple[DatalogEntry, ...]:
    return tuple(DatalogEntry(float(t), name, value, float(t) if timed else None) for t, value in enumerate(values))


@pytest.mark.parametrize(
    ("keys", "values", "marks"),
    [
        ({"at_least": 3}, [1, 2, 3], 4),
        ({"at_least": 4, "over": "mean"}, [1, 2, 3], 3),
        ({"at_most": 2}, [1, 2, 3], 0),
        ({"plateaus": [100, 0]}, [100, 100, 50, 0, 0], 4),
        ({"plateaus": [100, 0]}, [100, 0, 100, 0], 0),
        ({"plateaus": [100, 0], "plateau_samples": 1}, [100, 0], 4),
        ({"plateaus": [0, 100], "over": "mean"}, [100, 100, 0, 0], 2),
        ({"between": [0, 100]}, [0, 100], 4),
        ({"between": [0, 100]}, [0, 101], 0),
        ({"covers": [10, 90]}, [5, 95], 4),
        ({"covers": [10, 90]}, [15, 95], 0),
        ({}, [], 0),
    ],
)
def test_series_of_the_datalog(keys: dict[str, Any], values: list[float], marks: int) -> None:
    result = judged(criterion("datalog", series="Light_left", **keys), recorded(datalog=series(*values)))
    assert result.marks == marks, result.message


@pytest.mark.parametrize(
    ("instrument", "value", "genuine"),
    [
        ("left light", 51, True),
        ("left light", 20, True),
        ("left light", 40, True),
        ("left light", 100, False),
        ("right light", 100, True),
        ("right light", 51, False),
        ("gyro", 0, True),
        ("gyro", 90, False),
        ("left wheel", 360, False),
        ("ultrasonic", 50, False),
    ],
)
def test_only_what_was_read_counts_as_measured(instrument: str, value: float, genuine: bool) -> None:
    """The left sensor is over (51, 102, 153): 20, 40 and 60 percent."""
    rule = criterion("datalog", series="Light_left", measured=instrument, at_least=2)
    recording = recorded(rgb=(51, 102, 153), datalog=series(value, value))
    result = judged(rule, recording)
    assert result.marks == (4 if genuine else 0), result.message
    assert genuine or "none of the 2 samples is the reading" in result.message
    motionless = replace(recording, ticks=recorded(seconds=0).ticks)
    assert judged(rule, motionless).marks == 0


def test_a_reading_must_be_fresh_when_it_is_printed() -> None:
    """The light is white for a second, then black."""
    ticks = recorded(seconds=4).ticks
    ticks.left_sums[30:] = 0
    recording = recorded(
        seconds=4, ticks=ticks, datalog=tuple(DatalogEntry(t, "L", 100.0, t) for t in (0.0, 1.0, 1.4, 2.0, 3.0))
    )
    result = judged(criterion("datalog", series="L", measured="left light"), recording)
    assert result.evidence[0].measures[0].value == 3


def test_one_series_dips_below_another_and_samples_have_times() -> None:
    both = series(50, 20, name="Light_right") + series(50, 30)
    assert judged(criterion("datalog", series="Light_right", dips_below="Light_left"), recorded(datalog=both)).marks
    assert not judged(criterion("datalog", series="Light_left", dips_below="Light_right"), recorded(datalog=both)).marks
    untimed = recorded(datalog=series(1, 2, timed=False))
    assert not judged(criterion("datalog", series="Light_left", timed=True), untimed).marks


def image(pose: Pose, side: str = "left", tick: int = 1, noise: int = 0) -> tuple[str, str, int]:
    """Return the sensor's reading at ``pose`` on sheet 34, taken from the image itself."""
    drawn = build_floor("MNIST_Digits", seed=34).pixels
    column = int(pose.x) - (30 if side == "left" else -10)
    row = 1143 - int(pose.y) - 40
    pixels = np.full((20, 20, 4), 255, np.uint8)
    crop = drawn[row : row + 20, column : column + 20].astype(int)
    pixels[:, :, :3] = np.clip(crop + noise, 0, 255)
    return side, ",".join(map(str, pixels.ravel().tolist())), tick


def test_image_log_shows_what_lies_at_the_start() -> None:
    pose = Pose(600, 750, 90)
    rule = criterion("image_log", left=1, right=1, pairs=True, at_start=True, uniform="right")

    def run(*log: tuple[str, str, int]) -> Recording:
        return recorded(background="MNIST_Digits", sheet=34, start=pose, end=pose, image_log=log)

    pair = (image(pose), image(pose, "right"))
    assert judged(rule, run(*pair), poses=(pose,)).marks == 4
    assert judged(rule, run(*reversed(pair)), poses=(pose,)).marks == 0
    assert judged(rule, run(pair[0]), poses=(pose,)).marks == 0
    moved = Pose(603, 750, 90)
    elsewhere = judged(rule, run(image(moved), image(moved, "right")), poses=(pose,))
    assert "taken at the start pose" in elsewhere.message
    assert judged(rule, run(*pair, *pair), poses=(pose,)).marks == 0


@pytest.mark.parametrize(
    ("keys", "images", "marks"),
    [
        ({"left_at_least": 4}, 4, 4),
        ({"left_at_least": 4}, 9, 4),
        ({"left_at_least": 4}, 1, 1),
        ({"left_at_least": 4}, 0, 0),
        ({"left_at_least": 4, "right": 0}, 2, 3),
        ({"right_at_least": 1}, 4, 0),
    ],
)
def test_so_many_images_at_least(keys: dict[str, Any], images: int, marks: int) -> None:
    log = (image(Pose(600, 750, 90)),) * images
    result = judged(criterion("image_log", over="mean", **keys), recorded(background="MNIST_Digits", image_log=log))
    assert result.marks == marks, result.message


def test_image_log_without_images_has_no_marks() -> None:
    result = judged(criterion("image_log", at_start=True), recorded(background="MNIST_Digits"))
    assert "there is none" in result.message


def test_time_of_program_movement_and_speech() -> None:
    run = recorded(spoken=lines("one two", every=1))
    assert judged(criterion("timing", between=[2.9, 3.1]), run).marks == 4
    assert judged(criterion("timing", of="moving", between=[2.9, 3.1]), run).marks == 4
    assert judged(criterion("timing", of="speech", between=[0.9, 0.95]), run).marks == 4
    late = judged(criterion("timing", between=[1, 2]), run)
    assert late.marks == 0
    assert "to take from 1 to 2 s, but it took 3.00 s" in late.message


@pytest.mark.parametrize(
    ("steps", "highest", "marks"),
    [
        ([[3, 1], [10, 0.5]], False, 4),
        ([[2, 1], [10, 0.5]], False, 2),
        ([[1, 1], [2, 0.5]], False, 0),
        ([[3, 1], [1, 0.5]], True, 4),
        ([[5, 1], [1, 0.25]], True, 1),
        ([[1, 1], [10, 0.995]], False, Decimal("3.98")),
        ([[1, 1], [10, 0.999]], False, Decimal("4.00")),
    ],
)
def test_figure_of_another_criterion_is_worth_marks_by_steps(
    steps: list[list[float]], highest: bool, marks: Decimal
) -> None:
    ranked = criterion("ranking", of="ends", measure="time", steps=steps, highest=highest)
    ends = criterion("finishes").model_copy(update={"id": "ends"})
    assignment = Assignment("a", "A", WorldSpec(), Parts(), (Scenario("s", (START,)),), (ranked, ends))

    def marks_of(recording: Recording) -> Decimal:
        results = judge(assignment, (TrialResult("s", 0, 1, 0.0, 0.0, "visible", recording),))
        assert [result.id for result in results] == ["c", "ends"]
        return results[0].marks

    assert marks_of(recorded()) == marks
    assert marks_of(recorded(verdict=Verdict.TIME_LIMIT)) == 0


def test_the_share_of_a_step_is_told_as_it_is() -> None:
    ranked = criterion("ranking", of="ends", measure="time", steps=[[1, 1], [10, 0.995]])
    ends = criterion("finishes").model_copy(update={"id": "ends"})
    assignment = Assignment("a", "A", WorldSpec(), Parts(), (Scenario("s", (START,)),), (ranked, ends))
    results = judge(assignment, (TrialResult("s", 0, 1, 0.0, 0.0, "visible", recorded()),))
    assert "is worth 99.5% of the marks" in results[0].message


@pytest.mark.parametrize(
    ("check", "keys", "words"),
    [
        ("stop_on", {}, "has no condition"),
        ("stop_on", {"zone": [2, 2, 1, 3]}, "expected \\[left, bottom, right, top\\]"),
        ("reports", {"expected": "digit"}, "one for each pose"),
        ("reports", {"expected": [[]]}, "one for each pose"),
        ("reports", {"expected": [[True]]}, "one for each pose"),
        ("sequence", {"words": ["-"]}, "without a letter or digit"),
        ("sequence", {"words": ["1"], "source": "print", "waits": True}, "waits"),
        ("datalog", {"series": "Light_left", "plateaus": [100, 100.5]}, "two plateaus in a row"),
        ("datalog", {"series": "Light_left", "between": [5, 1]}, "an empty range"),
        ("image_log", {}, "has no condition"),
        ("timing", {"between": [3, 1]}, "an empty range"),
        ("ranking", {"of": "a", "measure": "m", "steps": [[1, 0.5], [2, 1]]}, "the best first"),
        ("source", {}, "has no condition"),
        ("source", {"flags": ["-y"]}, "needs a value"),
        ("source", {"in_loop": ["say"]}, "expected calls"),
        ("functions", {"calls": [{"returns": 1}], "each": True}, "expected a list in every returns"),
        ("functions", {"calls": [{"returns": 1}], "at_least": 0.5}, "at_least without each"),
    ],
)
def test_criterion_that_cannot_be_asked_is_refused(check: str, keys: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        criterion(check, **keys)


def _report_track(text: str, tick: int) -> Recording:
    """Return a run along x whose left sensor is over black from tick 30 to 60, and which says the text at this tick."""
    run = recorded()
    sums = run.ticks.left_sums.copy()
    sums[30:60] = 0
    ticks = replace(run.ticks, left_sums=sums)
    return replace(run, ticks=ticks, spoken=(TimedText((tick + 0.5) / 30, text),))


@pytest.mark.parametrize(("tick", "passes"), [(10, False), (45, True), (80, True)])
def test_reports_count_after_the_reading_that_they_are_about(tick: int, passes: bool) -> None:
    rule = criterion("reports", source="speech", expected=[[97]], after={"reflected": [0, 20]})
    result = judged(rule, _report_track("97 mm", tick))
    assert result.evidence[0].passed == passes
    assert ("nothing after the left light sensor had read 0 to 20 %" in result.message) == (not passes)
    never = criterion("reports", source="speech", expected=[[97]], after={"light": "right", "reflected": [0, 20]})
    assert "after the right light sensor had read" in judged(never, _report_track("97 mm", tick)).message


@pytest.mark.parametrize(("tick", "passes"), [(10, False), (45, True), (80, False)])
def test_reports_count_in_their_zone(tick: int, passes: bool) -> None:
    events = criterion("events", events=[{"text": "97", "zone": [0, 0, 2362, 1143]}])
    sensor_x = judged(events, _report_track("97", 45)).evidence[0].measures[0].value
    zone = [sensor_x - 5, 0, sensor_x + 5, 1143]
    rule = criterion("reports", source="speech", expected=[[97]], zone=zone)
    result = judged(rule, _report_track("97 mm", tick))
    assert result.evidence[0].passed == passes
    assert ("nothing while the left light sensor was at" in result.message) == (not passes)
