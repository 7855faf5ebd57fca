"""The channel's flags: their effects. A grade made with them says so and differs from all other grades."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from command import robomark
from replays import data_of
from responders.channel import Channel
from service.commands.options import ChannelFlags, apply_channel_flags
from submissions.assignment.examples import locate_examples

ECHO = locate_examples("json-queue") / "reference"
BEACON = Channel(loss=0.2, link="infrared", beacon=(500.0, 500.0), range=300)


def test_without_flags_nothing_changes() -> None:
    assert apply_channel_flags(BEACON, ChannelFlags().to_table()) is BEACON


@pytest.mark.parametrize(
    ("before", "flags", "after"),
    [
        (Channel(), {"loss": 0.4, "jitter": 1.0}, Channel(loss=0.4, jitter=1.0)),
        (BEACON, {"range": 900.0}, Channel(loss=0.2, link="infrared", beacon=(500.0, 500.0), range=900)),
        (BEACON, {"link": "cable"}, Channel(loss=0.2)),
        (
            Channel(delay=1),
            {"link": "infrared", "beacon": "40,50.5", "blocked_by": "nothing"},
            Channel(delay=1, link="infrared", beacon=(40.0, 50.5), blocked_by="nothing"),
        ),
    ],
)
def test_flags_change_what_they_name_and_nothing_else(before: Channel, flags: dict[str, Any], after: Channel) -> None:
    assert apply_channel_flags(before, ChannelFlags(**flags).to_table()) == after


def test_a_run_shows_what_was_lost(tmp_path: Path) -> None:
    trace, replay = tmp_path / "trace.json", tmp_path / "replay.html"
    result = robomark(
        *("run", ECHO / "robot.py", "--responder", ECHO / "responder.py", "--trace", trace, "--replay", replay),
        *("-b", "Empty_Map", "-x", "100", "-y", "800", "--link", "infrared", "--beacon", "900,800", "--range", "700"),
    )
    assert "(lost) PY::0: out of range, 800 mm away" in result.stdout
    first = json.loads(trace.read_text())["messages"][0]
    assert (first["lost"], first["distance"], first["angle"], first["delivered"]) == ("out of range", 800, 0, None)

    (trial,) = data_of(replay.read_text())["trials"]
    assert trial["messages"][0]["befell"] == "out of range, 800 mm away"
    assert trial["beacon"] == [900, 800]


def test_a_grade_on_another_channel_says_so() -> None:
    usual = json.loads(robomark("grade", ECHO, "-a", "json-queue", "--format", "json").stdout)
    away = ("--link", "infrared", "--beacon", "2000,800")
    lost = json.loads(robomark("grade", ECHO, "-a", "json-queue", *away, "--format", "json").stdout)
    assert usual["marks"] == 10 > lost["marks"]
    replies = next(line["message"] for line in lost["criteria"] if line["id"] == "content")
    assert 'Expected the responder to be sent "PY::0", but the channel lost it (the robot was 1900 mm' in replies
    output = robomark("grade", ECHO, "-a", "json-queue", *away).stdout
    assert "graded with another channel than the assignment's" in " ".join(output.split())
