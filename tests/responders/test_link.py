"""The infrared link: allowed positions and headings of the robot, compared with a hand-written rule and the ray."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from responders.channel import Cable, Channel, InfraredLink, TrialChannel
from responders.conversation import Answer, Conversation
from running import run_program
from service.grading.trial_runner import TrialRunner
from service.store.grades.recordings import from_bytes, to_bytes
from sim.arena import Arena
from sim.bullet import Client, pb
from sim.camera import HEIGHT, WIDTH
from sim.motion import Rectangle, add_block, build_walls
from sim.recording import SECOND, Pose
from sim.world import HashChain

BEACON = (1200.0, 600.0)
POST: Rectangle = (1000, 500, 40, 200)  # between the beacon and the area to its left
INFRARED: dict[str, Any] = {"link": "infrared", "beacon": BEACON, "range": 600, "facing": 90}


@pytest.fixture(scope="module")
def arena() -> Iterator[Arena]:
    made = Arena((POST,))
    yield made
    made.close()


def fate(arena: Arena, pose: Pose, **changes: Any) -> str:
    link = InfraredLink(Channel(**INFRARED | changes), arena, lambda: pose, lambda: BEACON)
    return link.measure_contact().lost or "arrives"


@pytest.mark.parametrize(
    ("x", "y", "heading", "becomes"),
    [
        # below the beacon, with a free path; 90 is up
        (1200, 300, 90, "arrives"),
        (1200, 300, 45.1, "arrives"),
        (1200, 300, 134.9, "arrives"),
        (1200, 300, 44.9, "facing away"),
        (1200, 300, 135.1, "facing away"),
        (1200, 300, -90, "facing away"),
        (1200, 300, 90 + 720, "arrives"),
        (1200, 300, 90 - 360, "arrives"),
        (1200, 0.5, 90, "arrives"),
        (1200, 1142, -90, "arrives"),
        (1200, 1142, 90, "facing away"),
        # to the right of it
        (1799.9, 600, 180, "arrives"),
        (1800.1, 600, 180, "out of range"),
        (1800.1, 600, 0, "out of range"),
        (1500, 600, -180, "arrives"),
        (1500, 600, 0, "facing away"),
        # to the left of it, behind the post
        (900, 600, 0, "blocked"),
        (900, 600, 180, "facing away"),
        (900, 900, -45, "arrives"),
        (900, 700, -18.4, "blocked"),
        (1020, 600, 0, "blocked"),  # inside the post: nothing stops a robot without solid = true
        (1041, 600, 0, "arrives"),
        (500, 600, 0, "out of range"),
        # beyond a wall
        (1200, -50, 90, "out of range"),
        (1200, 1150, -90, "blocked"),
        (1200, 600, 33, "arrives"),
    ],
)
def test_where_a_text_arrives(arena: Arena, x: float, y: float, heading: float, becomes: str) -> None:
    assert fate(arena, Pose(x, y, heading)) == becomes


@pytest.mark.parametrize(
    ("pose", "changes", "becomes"),
    [
        (Pose(900, 600, 0), {"blocked_by": "nothing"}, "arrives"),
        (Pose(1200, 300, -90), {"facing": 360}, "arrives"),
        (Pose(1200, 300, 95), {"facing": 10}, "arrives"),
        (Pose(1200, 300, 95.1), {"facing": 10}, "facing away"),
        (Pose(1200, 300, 90), {"range": 299}, "out of range"),
    ],
)
def test_what_the_keys_change(arena: Arena, pose: Pose, changes: dict[str, Any], becomes: str) -> None:
    assert fate(arena, pose, **changes) == becomes


def crosses(a: tuple[float, float], b: tuple[float, float], box: Rectangle) -> bool:
    """Return whether the segment from a to b has a point in the box (the slab method of Kay and Kajiya)."""
    first, last = 0.0, 1.0
    for start, end, low, size in zip(a, b, box[:2], box[2:], strict=True):
        if start == end:
            if not low <= start <= low + size:
                return False
            continue
        near, far = sorted(((low - start) / (end - start), (low + size - start) / (end - start)))
        first, last = max(first, near), min(last, far)
    return first <= last


def by_hand(pose: Pose) -> str:
    """Evaluate the rule independently, without sine, cosine or ray."""
    away = complex(BEACON[0] - pose.x, BEACON[1] - pose.y)
    if abs(away) > 600:
        return "out of range"
    bearing = math.degrees(math.atan2(away.imag, away.real))
    if min((bearing - pose.heading) % 360, (pose.heading - bearing) % 360) > 45:
        return "facing away"
    boxes = (POST, *build_walls().values())
    return "blocked" if any(crosses((pose.x, pose.y), BEACON, box) for box in boxes) else "arrives"


def undecided(pose: Pose) -> bool:
    """Return whether the pose is within a tenth of a mm or degree of the rule's boundary."""
    steps = (0.1, -0.1, 0)
    near = {by_hand(Pose(pose.x + dx, pose.y + dy, pose.heading + dh)) for dx in steps for dy in steps for dh in steps}
    return len(near) > 1


@given(st.floats(-90, WIDTH + 90), st.floats(-90, HEIGHT + 90), st.floats(-400, 400))
def test_the_link_is_the_rule_written_by_hand(arena: Arena, x: float, y: float, heading: float) -> None:
    pose = Pose(x, y, heading)
    assume(abs(complex(x, y) - complex(*BEACON)) > 1)
    assume(not undecided(pose))
    assert fate(arena, pose) == by_hand(pose)


@pytest.fixture(scope="module")
def blocks() -> Iterator[Client]:
    with Client() as client:
        for box in (POST, *build_walls().values()):
            add_block(box, client)
        yield client


def grown(box: Rectangle, by: float) -> Rectangle:
    return box[0] - by, box[1] - by, box[2] + 2 * by, box[3] + 2 * by


@given(st.floats(650, 1750), st.floats(1, HEIGHT - 1))
def test_what_blocks_is_what_a_ray_of_bullets_hits(arena: Arena, blocks: Client, x: float, y: float) -> None:
    """In a separate world with whole blocks, a ray misses its entry point by up to 0.7 mm; our world uses sheets."""
    assume(not crosses((x, y), (x, y), grown(POST, 0.1)))
    hits = {any(crosses((x, y), BEACON, grown(box, by)) for box in (POST, *build_walls().values())) for by in (-1, 1)}
    assume(len(hits) == 1)
    heading = math.degrees(math.atan2(BEACON[1] - y, BEACON[0] - x))
    start, end = ([x / 1000, y / 1000, 0.02], [BEACON[0] / 1000, BEACON[1] / 1000, 0.02])
    ((body, *_),) = pb.rayTest(start, end, physicsClientId=blocks.id)
    assert (fate(arena, Pose(x, y, heading), range=5000) == "blocked") is (body >= 0)


def test_the_other_end_may_move(arena: Arena) -> None:
    places = iter([(1200.0, 600.0), (100.0, 600.0)])
    link = InfraredLink(Channel(**INFRARED), arena, lambda: Pose(1200, 300, 90), lambda: next(places))
    assert [link.measure_contact().lost, link.measure_contact().lost] == ["", "out of range"]


def test_a_text_and_its_answer_are_lost_by_where_the_robot_is_when_they_cross(arena: Arena) -> None:
    pose = Pose(1200, 300, 90)
    channel = Channel(**INFRARED)
    talk = Conversation(channel, 1, HashChain(), InfraredLink(channel, arena, lambda: pose, lambda: BEACON))
    for number, turned in enumerate((80, -80, 90)):
        sent = talk.send(f"PY::{number}", number * SECOND)
        for copy in range(sent.copies):
            talk.record_answer(sent, copy, Answer(f"JSON::{number}", entry=str(number)))
        pose = Pose(1200, 300, turned)
        assert talk.deliver((number + 1) * SECOND) == (["0"] if number == 0 else [])
    first, back, second, lost_back, third = talk.messages
    assert (first.lost, first.distance, first.angle) == ("", 300, 0)
    assert (back.delivered, back.distance, back.angle) == (1.0, 300, 10)
    assert (second.lost, second.angle) == ("", 10)
    assert (lost_back.delivered, lost_back.note, lost_back.lost, lost_back.angle) == (None, "lost", "facing away", 170)
    assert (third.delivered, third.note, third.lost, third.angle) == (None, "lost", "facing away", 170)


ECHO = "def responder(text):\n    return 'JSON::{\"heard\": \"' + text[4:] + '\"}'\n"
TURNS = (
    "import time\nfor turn in range(6):\n    print('PY::' + str(turn))\n    time.sleep(0.2)\n"
    "    tank_turn.on_for_rotations(-100, SpeedPercent(30), 0.8)\n"
)


def test_the_recording_says_of_each_text_why_it_was_lost(runner: TrialRunner) -> None:
    channel = Channel(**INFRARED)
    recording = run_program(runner, TURNS, Pose(1200, 300, 90), responder=ECHO, channel=channel)
    robot_messages = [message for message in recording.messages if message.sender == "robot"]
    assert {message.lost for message in robot_messages} == {"", "facing away"}
    assert all((abs(message.angle or 0) > 45) is (message.lost == "facing away") for message in robot_messages)
    assert all((message.delivered is None) is bool(message.lost) for message in robot_messages)
    again = run_program(runner, TURNS, Pose(1200, 300, 90), responder=ECHO, channel=channel)
    assert again.sha256 == recording.sha256
    assert from_bytes(to_bytes(recording)).messages == recording.messages


def test_corruption_changes_letters_and_digits_after_the_prefix() -> None:
    line = TrialChannel(Channel(corruption=0.3), 5)
    arrived = [line.corrupt_text("PY::message 12", number) for number in range(2000)]
    assert arrived == [line.corrupt_text("PY::message 12", number) for number in range(2000)]
    changed = [text for text in arrived if text is not None]
    assert len(changed) / 2000 == pytest.approx(0.3, abs=0.04)
    for text in changed:
        assert text.startswith("PY::")
        assert (text[11], text[12:].isdigit(), len(text)) == (" ", True, 14)
        assert 1 <= sum(one != two for one, two in zip(text, "PY::message 12", strict=True)) <= 3


@pytest.mark.parametrize("text", ["", "PY::", "PY::!?", "PY::é"])
def test_what_has_no_letter_or_digit_cannot_be_corrupted(text: str) -> None:
    assert TrialChannel(Channel(corruption=1), 5).corrupt_text(text, 0) is None


def test_what_is_corrupted_arrives_so_and_joins_the_queue_only_if_it_is_still_json() -> None:
    talk = Conversation(Channel(corruption=1), 5, HashChain(), Cable())
    sent = talk.send("PY::7", 0)
    assert sent.text != "PY::7"
    assert talk.messages[0].received == sent.text
    talk.record_answer(sent, 0, Answer("JSON::[10]", entry="[10]"))
    talk.record_answer(sent, 0, Answer("JSON::true", entry="true"))
    (entry,) = talk.deliver(SECOND)
    assert entry != "[10]"
    assert talk.messages[1].received == f"JSON::{entry}"
    assert talk.messages[2].received != "JSON::true"
    assert talk.messages[2].delivered == 1
