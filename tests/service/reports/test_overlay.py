"""Comparison of two trials: which trials can be compared, who may see it, and where the two diverge."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import report_builders as build
from replays import data_of, parting_grade, values_of
from service.grading.grade import Grade, TrialResult
from service.reports.html import render_report_page
from service.reports.replay.document import build_grade_replay, compress_replay
from service.reports.replay.overlay import find_divergence
from service.reports.view import (
    BEFORE_PUBLICATION,
    OverlayTrials,
    build_staff_view,
    build_student_view,
    select_overlay_trials,
)
from sim.errors import UsageError
from sim.recording import BROWSER_TICK, Pose, Recording, Ticks, TimedText

PUBLISHED = BEFORE_PUBLICATION | {"after_published", "after_due_date"}


def straight(*moves: tuple[float, float, float], length: int = 100_000) -> Recording:
    """Return a recording that moves between these poses, one per tick, starting at time 0."""
    table = np.array(moves, float).reshape(-1, 3)
    start = Pose(0, 0, 0)
    end = Pose(*table[-1].tolist()) if len(table) else start
    ticks = Ticks(x=table[:, 0], y=table[:, 1], heading=table[:, 2], length=length)
    return replace(build.line_follower_recording(0), start=start, end=end, ticks=ticks, end_t=len(table) / 30)


def steps(count: int, x: float = 0, heading: float = 0) -> list[tuple[float, float, float]]:
    return [(x * tick, 0, heading * tick) for tick in range(1, count + 1)]


@pytest.mark.parametrize(
    ("one", "other", "moment"),
    [
        (straight(*steps(30, 5)), straight(*steps(30, 5)), None),
        (straight(*steps(30)), straight(*steps(30, 1)), 11 / 30),  # 10 mm are not more than 10 mm
        (straight(*steps(30)), straight(*steps(30, 0, -1)), 6 / 30),
        (straight(*steps(3)), straight((0, 0, 0), (0, 0, 360), (0, 0, 724)), None),
        (straight(*steps(3)), straight((0, 0, 0), (0, 0, 360), (0, 0, 726)), 3 / 30),
        (straight(*steps(5, 5)), straight(*steps(30, 5)), 8 / 30),  # one trial has ended, the other robot continues
        (straight(), straight(*steps(30, 4)), 3 / 30),
        (straight(), straight(), None),
        (straight(*steps(30, 1)), straight(*steps(30, 0.99, 0), length=BROWSER_TICK), None),
    ],
)
def test_they_part_where_poses_differ_by_more_than_10_mm_or_5_degrees(
    one: Recording, other: Recording, moment: float | None
) -> None:
    assert (
        find_divergence(one, other)
        == find_divergence(other, one)
        == (None if moment is None else pytest.approx(moment))
    )


def test_of_two_robots_the_first_that_differs_tells_where_they_part() -> None:
    one = replace(straight(*steps(30)), partner=straight(*steps(30)))
    other = replace(straight(*steps(30, 1)), partner=straight(*steps(30, 2)))
    assert find_divergence(one, other) == pytest.approx(6 / 30)


def as_of(student: str) -> Grade:
    return replace(parting_grade(), student=student)


def hiding(grade: Grade) -> Grade:
    """Return the same grade with its second trial hidden."""
    return replace(grade, trials=(grade.trials[0], replace(grade.trials[1], visibility="hidden")))


def test_the_same_scenario_seed_and_place_lie_over_each_other() -> None:
    view = build_student_view(build.line_follower_grade())
    other = parting_grade()
    others = select_overlay_trials(view, replace(other, trials=other.trials[::-1]), "attempt 1", BEFORE_PUBLICATION)
    assert {index: trial.scenario for index, trial in others.trials.items()} == {0: "plain", 1: "with-obstacle"}


@pytest.mark.parametrize(
    "elsewhere",
    [
        lambda trial: replace(trial, seed=99),
        lambda trial: replace(trial, scenario="renamed"),
        lambda trial: replace(trial, place=1),
        lambda trial: replace(trial, light_noise=5.0),
        lambda trial: replace(trial, recording=replace(trial.recording, background="Loop")),
    ],
)
def test_what_was_run_otherwise_lies_over_nothing(elsewhere: Callable[[TrialResult], TrialResult]) -> None:
    view, other = build_student_view(build.line_follower_grade()), parting_grade()
    one = replace(other, trials=(elsewhere(other.trials[0]), other.trials[1]))
    assert set(select_overlay_trials(view, one, "attempt 1", BEFORE_PUBLICATION).trials) == {1}
    none = replace(other, trials=tuple(elsewhere(trial) for trial in other.trials[:1]))
    with pytest.raises(UsageError, match="none lies over another"):
        select_overlay_trials(view, none, "attempt 1", BEFORE_PUBLICATION)
    with pytest.raises(UsageError, match="none lies over another"):
        select_overlay_trials(view, replace(other, assignment="another"), "attempt 1", BEFORE_PUBLICATION)


@pytest.mark.parametrize(
    ("student", "released", "refused"),
    [
        ("s1234567", BEFORE_PUBLICATION, None),
        ("reference", PUBLISHED, None),
        ("reference", BEFORE_PUBLICATION, "once the grade is published"),
        ("reference", BEFORE_PUBLICATION | {"after_due_date"}, "once the grade is published"),
        ("s7654321", BEFORE_PUBLICATION, "another student's"),
        ("s7654321", PUBLISHED, "another student's"),
    ],
)
def test_a_student_sees_their_own_and_once_published_the_references(
    student: str, released: frozenset[str], refused: str | None
) -> None:
    view = build_student_view(build.line_follower_grade(), released)
    if refused is None:
        assert set(select_overlay_trials(view, as_of(student), "other", released).trials) == {0, 1}
    else:
        with pytest.raises(UsageError, match=refused):
            select_overlay_trials(view, as_of(student), "other", released)
    staff = build_staff_view(build.line_follower_grade())
    assert set(select_overlay_trials(staff, as_of(student), "other", released).trials) == {0, 1}


@pytest.mark.parametrize("released", [BEFORE_PUBLICATION, PUBLISHED])
def test_a_trial_that_either_hides_lies_over_nothing_for_a_student(released: frozenset[str]) -> None:
    mine, other = build.line_follower_grade(), parting_grade()
    for one, two in ((hiding(mine), other), (mine, hiding(other)), (hiding(mine), hiding(other))):
        assert set(select_overlay_trials(build_student_view(one, released), two, "other", released).trials) == {0}
        assert set(select_overlay_trials(build_staff_view(one), two, "other", released).trials) == {0, 1}


def test_nothing_hidden_is_in_a_students_replay() -> None:
    mine, other = hiding(build.line_follower_grade()), hiding(parting_grade())
    secret = replace(other.trials[1].recording, printed=(TimedText(1.0, "SECRETPRINT"),))
    other = replace(other, trials=(other.trials[0], replace(other.trials[1], recording=secret)))
    for view, each in ((build_student_view(mine), False), (build_staff_view(mine), True)):
        replay = build_grade_replay(
            view, overlay_trials=select_overlay_trials(view, other, "other", BEFORE_PUBLICATION)
        )
        assert ("SECRETPRINT" in json.dumps(replay)) is each


def test_of_the_other_trial_there_is_what_is_drawn_and_told_and_no_more() -> None:
    view, other = build_student_view(build.line_follower_grade()), parting_grade()
    others = select_overlay_trials(view, other, "attempt 1", BEFORE_PUBLICATION)
    replay = data_of(render_report_page(view, {}, build.faulty_submission(), overlay_trials=others))
    assert replay["version"] == 1
    over = replay["trials"][1]["over"]
    assert over.keys() == {
        "name", "verdict", "ended", "seconds", "tick", "messages", "events", "left_out", "robots", "parted",
    }  # fmt: skip
    assert (over["name"], over["seconds"]) == ("attempt 1", 12.0)
    assert over["parted"] == pytest.approx(find_divergence(view.grade.trials[1].recording, other.trials[1].recording))
    (robot,) = over["robots"]
    assert robot["columns"].keys() == {"x", "y", "heading", "left_position", "right_position"}
    assert np.abs(values_of(robot["columns"]["x"])[:, 0] - other.trials[1].recording.ticks.x).max() < 0.006
    assert robot["images"] == []
    assert [event["text"] for event in over["events"]] == ["off I go", "straight on", "there"]
    assert all("line" not in each for each in (*over["events"], *over["messages"]))


def test_without_another_there_is_no_word_of_one() -> None:
    view = build_student_view(build.line_follower_grade())
    assert all("over" not in trial for trial in build_grade_replay(view)["trials"])
    only = OverlayTrials("attempt 1", {1: parting_grade().trials[1]})
    assert ["over" in trial for trial in build_grade_replay(view, overlay_trials=only)["trials"]] == [False, True]


def test_another_trial_takes_its_room_in_a_report() -> None:
    view = build_student_view(build.line_follower_grade())
    others = select_overlay_trials(view, parting_grade(), "attempt 1", BEFORE_PUBLICATION)
    alone = sum(len(compress_replay(trial)) for trial in build_grade_replay(view)["trials"])
    assert len(build_grade_replay(view, max_bytes=alone + 100)["trials"]) == 2
    assert len(build_grade_replay(view, max_bytes=alone + 100, overlay_trials=others)["trials"]) == 1


def test_hostile_names_and_texts_are_visible_and_capped() -> None:
    view = build_student_view(build.hostile_grade())
    others = select_overlay_trials(view, build.hostile_grade(), build.HOSTILE * 99, BEFORE_PUBLICATION)
    over = build_grade_replay(view, overlay_trials=others)["trials"][0]["over"]
    output = json.dumps(over, ensure_ascii=False)
    assert not {"\x1b", "\x00", "\u202e", "\u200b", "\u2028"} & set(output)
    assert len(over["name"]) <= 60
    assert over["left_out"] == 3001 - 2000
    assert over["parted"] is None
