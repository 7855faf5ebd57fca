"""An animation of a trial: a GIF with few frames, the robot at the right places, and a bounded size."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import report_builders as build
from replays import long_recording
from service.grading.grade import TrialResult
from service.reports.film import FRAME_MILLISECONDS, MAX_FRAMES, render_film
from service.reports.output_files import write_film
from sim.errors import UsageError
from sim.recording import Pose, Recording, Touch

LEFT_LIGHT, RIGHT_LIGHT = (11, 74, 134), (217, 121, 26)


def trial_of(recording: Recording) -> TrialResult:
    return TrialResult("run", 0, 0, 0, 0, "visible", recording)


def frames_of(data: bytes) -> list[np.ndarray]:
    return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(Image.open(io.BytesIO(data)))]


def place_of(colour: tuple[int, int, int], frame: np.ndarray) -> np.ndarray:
    """Return the mean position of the pixels of a colour, above the strip."""
    rows, columns = np.nonzero(np.abs(frame[:-60].astype(int) - colour).max(axis=2) < 6)
    return np.array([columns.mean(), -rows.mean()])


def circling(count: int) -> Recording:
    """Return a robot that turns left on white paper."""
    recording = build.line_follower_recording(count, "Empty_Map", Pose(800, 500, 0))
    turned = np.linspace(0, 90, count)
    ticks = replace(recording.ticks, x=np.full(count, 800.0), y=np.full(count, 500.0), heading=turned)
    return replace(recording, ticks=ticks, end=Pose(800, 500, 90), pen=())


def test_the_robot_heads_where_it_did() -> None:
    frames = frames_of(render_film(trial_of(circling(60)), {}))
    ways = [place_of(RIGHT_LIGHT, frame) - place_of(LEFT_LIGHT, frame) for frame in (frames[0], frames[-1])]
    headings = [np.degrees(np.arctan2(way[1], way[0])) + 90 for way in ways]  # right sensor to the right
    assert headings == pytest.approx([0, 90], abs=3)


def test_time_is_as_long_as_it_was_and_the_last_frame_stays() -> None:
    image = Image.open(io.BytesIO(render_film(trial_of(build.line_follower_recording(90)), {})))
    durations = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert sum(durations[:-1]) == pytest.approx(3000, abs=2 * FRAME_MILLISECONDS)
    assert durations[-1] == 2000
    assert image.info["loop"] == 0
    assert image.width == 640


@pytest.mark.parametrize("count", [0, 1])
def test_a_trial_without_ticks_has_a_film(count: int) -> None:
    assert len(frames_of(render_film(trial_of(build.line_follower_recording(count)), {}))) >= 1


@pytest.mark.long
def test_two_robots_hostile_texts_and_far_ways_break_nothing() -> None:
    hostile = build.hostile_grade().trials[0].recording
    recording = build.line_follower_recording(45)
    away = replace(recording.ticks, x=recording.ticks.x + np.linspace(0, 1e9, 45))
    lost = replace(recording.ticks, x=np.full(45, np.nan))
    touches = tuple(Touch(index / 5000, "wall", Pose(np.nan, 0, 0)) for index in range(5000))
    for own in (
        replace(recording, printed=hostile.printed, messages=hostile.messages, partner=recording),
        replace(recording, ticks=away, beacon=(300.0, 400.0)),
        replace(recording, ticks=lost, touches=touches),
        replace(recording, background="gone.png"),
    ):
        assert len(frames_of(render_film(trial_of(own), {}))) > 10


def test_a_floor_of_the_assignments_own_is_filmed() -> None:
    recording = replace(circling(1), background="own.png")
    red = np.full((1143, 2362, 3), (200, 30, 30), np.uint8)
    assert (
        np.abs(
            frames_of(render_film(trial_of(recording), {"own.png": red}))[0][2, 320].astype(int) - (200, 30, 30)
        ).max()
        < 9
    )
    assert frames_of(render_film(trial_of(recording), {}))[0][2, 320].tolist() == [255, 255, 255]


@pytest.mark.long
def test_ten_minutes_make_no_more_frames_than_a_minute() -> None:
    data = render_film(trial_of(long_recording(18_000, images=500)), {})
    assert Image.open(io.BytesIO(data)).n_frames <= MAX_FRAMES  # type: ignore[attr-defined]
    assert len(data) < 6_000_000


def test_a_film_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be written"):
        write_film(tmp_path / "file" / "film.gif", trial_of(build.line_follower_recording(1)), {})
