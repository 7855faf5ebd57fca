"""A recording as plain numbers."""

import json
from dataclasses import replace

import numpy as np

import report_builders as build
from service.reports.trace import build_trace
from sim.recording import DatalogEntry, TimedText


def test_keys_rows_and_values() -> None:
    recording = build.line_follower_recording(300)
    document = build_trace(recording)
    assert list(document) == [
        "ticks", "printed", "spoken", "messages", "datalog", "images", "verdict", "start", "end", "sha256", "sandbox",
    ]  # fmt: skip
    assert list(document["ticks"])[:10] == [
        "t", "x", "y", "heading", "left_position", "right_position", "left_rgb", "right_rgb", "ultrasonic", "gyro",
    ]  # fmt: skip
    assert {len(column) for column in document["ticks"].values()} == {300}
    assert document["ticks"]["t"][29] == 1.0
    assert document["ticks"]["x"][-1] == document["end"]["x"] == recording.end.x
    assert len(document["ticks"]["left_rgb"][0]) == 3
    assert document["start"] == {"t": 0.0, "x": 750, "y": 375, "heading": -180}
    assert document["spoken"][0] == [0.5, "off we go"]
    assert document["end"]["t"] == 10.0
    json.dumps(document, allow_nan=False)


def test_images_of_both_kinds() -> None:
    sent = build_trace(build.shape_grade().trials[2].recording)["images"][0]
    assert len(sent["left"]) == len(sent["right"]) == 1600
    assert (sent["x"], sent["truth"], sent["source"]) == (360.0, "left facing triangle", "IMG_DATA")
    collected = build_trace(build.line_follower_recording(60))["images"][0]
    assert (collected["source"], collected["t"], len(collected["left"])) == ("image_data", 1.0, 1600)


def test_nothing_that_json_cannot_hold() -> None:
    recording = build.line_follower_recording(3)
    strange = replace(
        recording,
        ticks=replace(recording.ticks, x=np.array([np.nan, np.inf, 1.0])),
        datalog=(DatalogEntry(0.0, "\ud800", float("inf"), None),),
        printed=(TimedText(0.0, "\ud800"),),
    )
    document = build_trace(strange)
    assert document["ticks"]["x"] == [None, None, 1.0]
    assert document["datalog"][0]["value"] is None
    json.dumps(document, allow_nan=False, ensure_ascii=False).encode()


def test_a_trial_without_ticks() -> None:
    document = build_trace(build.line_follower_recording(0))
    assert document["ticks"]["left_rgb"] == []
    json.dumps(document, allow_nan=False)
