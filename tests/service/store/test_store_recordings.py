"""The store keeps recordings and assignments bit for bit. Recordings that are too large are cut and marked."""

from __future__ import annotations

import pickle
import zlib
from dataclasses import fields, replace
from math import inf, nan
from typing import Any, get_origin

import numpy as np
import pytest

import report_builders
from service.grading.grade import Grade
from service.store import codec
from service.store.courses.assignment_versions import assignment_from_bytes, assignment_to_bytes
from service.store.grades.recording_texts import RecordingError, texts_from_bytes
from service.store.grades.recordings import encode_within_limit, from_bytes, to_bytes
from sim.recording import COLUMNS, Message, Recording, Ticks, TimedText
from submissions.assignment.folder import list_catalogue_ids
from submissions.assignment.reader import find_assignment

pytestmark = pytest.mark.fast

GRADES = {
    "line-follower": report_builders.line_follower_grade,
    "shapes": report_builders.shape_grade,
    "faulty": report_builders.faulty_grade,
    "hostile": report_builders.hostile_grade,
}


def _recordings(grade: Grade) -> list[Recording]:
    return [trial.recording for trial in grade.trials]


def _assert_same(one: Recording, other: Recording) -> None:
    for field in fields(Recording):
        if field.name != "ticks":
            assert getattr(one, field.name) == getattr(other, field.name), field.name
    for field in fields(Ticks):
        left, right = getattr(one.ticks, field.name), getattr(other.ticks, field.name)
        if isinstance(left, np.ndarray):
            assert left.dtype == right.dtype
            assert left.shape == right.shape
            assert left.tobytes() == right.tobytes(), field.name
        else:
            assert left == right, field.name


@pytest.mark.parametrize("name", GRADES)
def test_a_recording_comes_back_as_it_was(name: str) -> None:
    for recording in _recordings(GRADES[name]()):
        _assert_same(recording, from_bytes(to_bytes(recording)))
        beside = replace(recording, partner=recording)
        read = texts_from_bytes(to_bytes(beside))
        assert read.partner is not None
        assert _words(read) == _words(beside)
        assert _words(read.partner) == _words(recording)


def _words(recording: Recording) -> list[object]:
    images = tuple(replace(image, left=b"", right=b"") for image in recording.images)
    own = replace(recording, images=images, partner=None)
    return [getattr(own, field.name) for field in fields(Recording) if field.name != "ticks"]


def test_odd_values_come_back_as_they_were() -> None:
    recording = report_builders.line_follower_recording(40)
    odd = np.array([0.0, -0.0, nan, inf, -inf, 5e-324, 1.7e308, 1 / 3] * 5)
    odd_recording = replace(
        recording,
        end_t=inf,
        ticks=replace(recording.ticks, x=odd, gyro=odd[::-1].copy()),
        printed=(TimedText(0.1, "\0 \ud800 \U0001f916 \u202e"), TimedText(0.2, "")),
        messages=(Message(0.1, "robot", "PY::\n\"'", None), Message(0.2, "responder", "", 0.3, 0, "lost")),
    )
    _assert_same(odd_recording, from_bytes(to_bytes(odd_recording)))


def test_types_are_read_once_however_many_messages_a_recording_has(monkeypatch: pytest.MonkeyPatch) -> None:
    def count_reads(messages: int) -> int:
        data = to_bytes(
            replace(
                report_builders.line_follower_recording(), messages=(Message(0.5, "robot", "PY::1", 0.6),) * messages
            )
        )
        reads = 0

        def read_origin(kind: Any) -> Any:
            nonlocal reads
            reads += 1
            return get_origin(kind)

        monkeypatch.setattr(codec, "get_origin", read_origin)
        assert len(texts_from_bytes(data).messages) == messages
        return reads

    assert count_reads(1000) <= count_reads(1) + 50


def test_a_recording_without_ticks_comes_back() -> None:
    recording = report_builders.line_follower_recording(0)
    _assert_same(recording, from_bytes(to_bytes(recording)))


def test_a_recording_that_is_older_than_a_column_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = report_builders.line_follower_recording(40)
    older = tuple(column for column in COLUMNS if column.name not in ("gyro", "right_sums"))
    with monkeypatch.context() as then:
        then.setattr("service.store.grades.recordings.COLUMNS", older)
        data = to_bytes(recording)
    ticks = from_bytes(data).ticks
    assert np.isnan(ticks.gyro).all()
    assert ticks.gyro.shape == (40,)
    assert ticks.right_sums.tolist() == [[0, 0, 0]] * 40
    assert ticks.left_sums.tobytes() == recording.ticks.left_sums.tobytes()


def test_an_older_recording_lost_its_messages_by_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    lost, arrived = Message(0.1, "robot", "PY::0", None, None, "lost"), Message(0.2, "robot", "PY::0", 0.2)
    recording = replace(report_builders.line_follower_recording(1), messages=(lost, arrived))
    newer = ("lost", "distance", "angle", "arrived_as")
    with monkeypatch.context() as then:
        then.setattr("service.store.codec.fields", lambda each: [f for f in fields(each) if f.name not in newer])
        data = to_bytes(recording)
    assert from_bytes(data).messages == (replace(lost, lost="chance"), arrived)


def test_a_minute_of_driving_takes_less_than_half_of_its_raw_size() -> None:
    recording = report_builders.line_follower_recording(1800)
    assert len(to_bytes(recording)) < 1800 * 13 * 8 / 2


@pytest.mark.parametrize(
    "data",
    [b"", b"nothing", zlib.compress(b"nothing"), zlib.compress(pickle.dumps({"words": "x"}))],
    ids=["empty", "text", "compressed text", "pickle"],
)
def test_other_bytes_are_refused(data: bytes) -> None:
    for read in (from_bytes, texts_from_bytes):
        with pytest.raises(RecordingError):
            read(data)


def test_a_cut_recording_is_refused() -> None:
    data = to_bytes(report_builders.line_follower_recording(30))
    with pytest.raises(RecordingError):
        from_bytes(data[: len(data) // 2])


@pytest.mark.long
@pytest.mark.parametrize("cap", [40_000, 5_000, 1_500])
def test_what_is_too_large_is_cut_and_says_so(cap: int) -> None:
    recording = report_builders.line_follower_recording(300)
    noise = np.random.default_rng(1)
    flood = replace(
        recording, printed=tuple(TimedText(float(i), noise.bytes(40).hex()) for i in range(20_000)), images=()
    )
    kept = encode_within_limit(flood, cap)
    assert len(kept.data) <= cap
    cut = from_bytes(kept.data)
    assert "too large" in cut.notes[-1]
    for name in ("verdict", "sha256", "end", "end_t", "start"):
        assert getattr(cut, name) == getattr(flood, name)


@pytest.mark.long
@pytest.mark.parametrize("name", list_catalogue_ids())
def test_an_assignment_comes_back_as_it_was(name: str) -> None:
    assignment = find_assignment(name)
    back = assignment_from_bytes(assignment_to_bytes(assignment))
    assert back == assignment
    assert list(back.trials()) == list(assignment.trials())
    assert assignment_to_bytes(back) == assignment_to_bytes(assignment)


def test_an_assignment_keeps_its_secret_and_its_images() -> None:
    assignment = find_assignment("echo-responder")
    world = replace(assignment.world, image=bytes(range(256)), obstacles=((1.0, 2.0, 3.0, 4.0),))
    changed = replace(assignment, secret="hush", given={"a.bin": b"\0\xff"}, world=world)
    assert assignment_from_bytes(assignment_to_bytes(changed)) == changed
