"""Two robots in one world: shared time and message order, and neither can stop, inspect or delay the other."""

from __future__ import annotations

import time
from itertools import pairwise

import pytest

from responders.channel import Channel
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.errors import Cancelled
from sim.motion import Physics
from sim.recording import Message, Pose, Recording, Verdict
from sim.recording_values import collect_faults, decide_verdict
from sim.world import World

LEFT, RIGHT = Pose(500, 500, 0), Pose(1500, 500, 180)
GLUE = "import time, ev3dev2_glue as glue\n"
WAIT = "while not glue.pyState()['messages']:\n    time.sleep(0.1)\n"
TELL = GLUE + "time.sleep(0.25)\nprint('PY::hello')\n"
LISTEN = GLUE + WAIT + "print(glue.pyState()['messages'][0])\n"
AHEAD = "tank_drive.on_for_seconds(30, 30, 2)\n"
NAMES_SENDER = "def responder(text):\n    return 'JSON::' + str(sender)"


def run_both(runner: TrialRunner, first: str, second: str, **more: object) -> tuple[Recording, Recording]:
    recording = run_program(runner, first, LEFT, second=second, second_start=RIGHT, **more)  # type: ignore[arg-type]
    assert recording.partner is not None
    assert recording.partner.partner is None
    return recording, recording.partner


def printed(recording: Recording) -> list[str]:
    return [line.text for line in recording.printed]


def answers(recording: Recording) -> list[str]:
    return [message.text for message in recording.messages if message.sender == "responder"]


@pytest.mark.parametrize("text", ["import time\ntime.sleep(1)", AHEAD, "while True:\n    colorLeft.rgb\n"])
def test_a_robot_beside_which_nothing_happens_drives_as_it_does_alone(runner: TrialRunner, text: str) -> None:
    alone = run_program(runner, text, LEFT, seconds=3)
    first, second = run_both(runner, text, "pass", seconds=3)
    assert first.end == alone.end
    assert first.ticks.x.tolist() == alone.ticks.x.tolist()
    assert first.ticks.left_sums.tolist() == alone.ticks.left_sums.tolist()
    assert (first.verdict, first.end_t) == (alone.verdict, alone.end_t)
    assert (second.end, second.end_t, len(second.ticks)) == (RIGHT, 0.0, 0)


def test_each_knows_its_number_and_has_chance_of_its_own(runner: TrialRunner) -> None:
    text = GLUE + "import random\nprint(glue.robot_number(), random.random())"
    first, second = run_both(runner, text, text)
    assert [printed(each)[0][0] for each in (first, second)] == ["1", "2"]
    assert printed(first)[0][2:] != printed(second)[0][2:]
    alone = run_program(runner, text, LEFT)
    assert printed(alone) == printed(first)


@pytest.mark.parametrize("forward", [True, False])
def test_a_text_is_heard_by_the_other_robot_as_late_as_the_channel_says(runner: TrialRunner, forward: bool) -> None:
    programs = (TELL, LISTEN) if forward else (LISTEN, TELL)
    both = run_both(runner, *programs, channel=Channel(delay=0.3))
    teller, listener = both if forward else reversed(both)
    due = 17 / 30  # the first tick from 0.25 + 0.3 on
    assert listener.messages == (Message(0.25, "partner", "PY::hello", due),)
    assert printed(listener) == ["hello"]
    # The sender's program ended long before.
    assert teller.messages == (Message(0.25, "robot", "PY::hello", due, to_partner=True),)


@pytest.mark.parametrize(
    ("sent_text", "heard"),
    [
        ("PY::3", "'3'"),
        ("PY::JSON::[1, 2.0]", "[1, 2]"),
        ('PY::JSON::{"x": {"y": null}}', "{'x': {'y': None}}"),
        ("PY::", "''"),
        ("PY::\\u00e4 \\\\ '\\n", '"ä \\\\ \'\\n"'),
    ],
)
def test_what_is_heard(runner: TrialRunner, sent_text: str, heard: str) -> None:
    listen = GLUE + WAIT + "print(repr(glue.pyState()['messages'][0]))\n"
    _, listener = run_both(runner, f'print("""{sent_text}""")', listen, seconds=2)
    assert printed(listener) == [heard]


def test_an_image_is_heard_as_an_object(runner: TrialRunner) -> None:
    listen = GLUE + WAIT + "seen = glue.pyState()['messages'][0]\nprint(sorted(seen), len(seen['left'].split(',')))\n"
    first, second = run_both(runner, "print('IMG_DATA')", listen)
    assert printed(second) == ["['left', 'right'] 1600"]
    assert len(first.images) == 1


def test_a_text_that_is_not_the_json_it_says_it_is_joins_no_queue(runner: TrialRunner) -> None:
    first, second = run_both(runner, "print('PY::JSON::{oops')", GLUE + "time.sleep(1)\nprint(glue.pyState())")
    assert printed(second) == ["{'messages': []}"]
    assert [(fault.who, fault.verdict) for fault in first.faults] == [("program", Verdict.PROTOCOL_ERROR)]
    assert second.faults == ()


@pytest.mark.parametrize(
    ("channel", "delivered", "note", "heard"),
    [
        (Channel(loss=1.0), False, "lost", 0),
        (Channel(duplication=1.0), True, "duplicated", 2),
        (Channel(delay=50), False, "undelivered", 1),
    ],
)
def test_what_befalls_a_text_on_its_way_is_told_to_both(
    runner: TrialRunner, channel: Channel, delivered: bool, note: str, heard: int
) -> None:
    first, second = run_both(runner, TELL, GLUE + "time.sleep(2)", channel=channel)
    (message,) = first.messages
    assert (message.delivered is not None, message.note) == (delivered, note)
    assert len(second.messages) == heard


BETWEEN = Channel(link="between robots", range=1100.0, facing=90.0)


@pytest.mark.parametrize(
    ("first", "second", "lost"),
    [
        (LEFT, RIGHT, ""),
        (LEFT, Pose(1700, 500, 180), "out of range"),
        (Pose(500, 500, 90), RIGHT, "facing away"),
        (LEFT, Pose(1500, 500, 0), "facing away"),
    ],
)
def test_between_robots_both_must_be_in_reach_and_face_each_other(
    runner: TrialRunner, first: Pose, second: Pose, lost: str
) -> None:
    recording = run_program(
        runner, TELL, first, second=GLUE + "time.sleep(1)\nprint(glue.pyState()['messages'])", second_start=second,
        channel=BETWEEN,
    )  # fmt: skip
    assert recording.partner is not None
    (message,) = recording.messages
    assert (message.lost, message.delivered is None) == (lost, bool(lost))
    assert printed(recording.partner) == ["[]" if lost else "['hello']"]


def test_an_obstacle_between_robots_blocks(runner: TrialRunner) -> None:
    first, second = run_both(
        runner, TELL, "import time\ntime.sleep(1)", channel=BETWEEN, obstacles=((900, 400, 50, 200),)
    )
    assert [message.lost for message in first.messages] == ["blocked"]
    assert second.messages == ()


def test_what_the_channel_corrupts_is_heard_so_and_is_no_fault(runner: TrialRunner) -> None:
    program_text = "print('PY::JSON::[true]')\nprint('PY::abc')"
    first, second = run_both(
        runner, program_text, GLUE + "time.sleep(1)\nprint(glue.pyState())", channel=Channel(corruption=1.0)
    )
    assert first.faults == second.faults == ()
    assert all(message.arrived_as not in (None, message.text) for message in (*first.messages, *second.messages))
    assert "abc" not in printed(second)[0]


def test_one_responder_knows_who_speaks_and_answers_who_has_asked(runner: TrialRunner) -> None:
    ask = GLUE + "print('PY::who?')\n" + WAIT + "print(glue.pyState()['messages'])"
    first, second = run_both(runner, ask, ask, responder=NAMES_SENDER)
    assert answers(first) == ["JSON::1"]
    assert answers(second) == ["JSON::2"]
    assert (printed(first)[-1], printed(second)[-1]) == ("[1]", "[2]")


def test_a_responders_own_sender_is_left_alone(runner: TrialRunner) -> None:
    first, _ = run_both(runner, "print('PY::who?')", "pass", responder="sender = 'me'\n" + NAMES_SENDER)
    assert answers(first) == ["JSON::me"]


def test_a_responder_hears_both_in_the_order_in_which_they_spoke(runner: TrialRunner) -> None:
    # Both speak several times between two ticks. The first robot's program is served first.
    speak = "import time\nfor i in range(20):\n    time.sleep({})\n    print('PY::', {})\n"
    responder = "said = []\ndef responder(text):\n    said.append(text)\n    return str(len(said))"
    first, second = run_both(runner, speak.format(0.013, 1), speak.format(0.007, 2), responder=responder)
    robot_messages = [
        (message.t, robot, int(answer.text))
        for robot, each in ((1, first), (2, second))
        for message, answer in pairwise(sorted(each.messages, key=lambda m: (m.t, m.sender == "responder")))
        if message.sender == "robot" and answer.sender == "responder"
    ]
    assert len(robot_messages) == 40
    assert [number for _, _, number in sorted(robot_messages)] == list(range(1, 41))


def test_what_a_responder_calls_is_told_with_the_robot_that_asked(runner: TrialRunner) -> None:
    responder = "parser = lambda text: text[4:]\ndef responder(text):\n    return parser(text)"
    first, second = run_both(runner, "print('PY::a')\nprint('PY::b')", "print('PY::c')", responder=responder)
    assert [(call.message, call.result) for call in first.calls] == [(0, "'a'"), (1, "'b'")]
    assert [(call.message, call.result) for call in second.calls] == [(0, "'c'")]


def test_they_see_and_touch_each_other_and_drive_through(runner: TrialRunner) -> None:
    look = GLUE + "tank_drive.on_for_seconds(40, 40, 6)\nprint(ultrasonic.distance_centimeters)"
    first, second = run_both(runner, look, "pass")
    assert first.end.x == pytest.approx(1677, abs=1)
    assert {touch.what for touch in first.touches} == {"robot 2"}
    assert second.touches == ()
    assert first.ticks.ultrasonic[0] == 1500 - 45 - 520


@pytest.mark.parametrize("physics", [Physics(solid=True), Physics(solid=True, drive="wheels")])
def test_solid_robots_stop_each_other(runner: TrialRunner, physics: Physics) -> None:
    ahead = "tank_drive.on_for_seconds(40, 40, 6)"
    first, second = run_both(runner, ahead, ahead, physics=physics)
    assert second.end.x - first.end.x == pytest.approx(90, abs=2)
    assert {"robot 2"} <= {touch.what for touch in first.touches}
    assert {"robot 1"} <= {touch.what for touch in second.touches}
    again, _ = run_both(runner, ahead, ahead, physics=physics)
    assert again.sha256 == first.sha256


def test_the_first_ones_hash_is_over_both(runner: TrialRunner) -> None:
    one, _ = run_both(runner, AHEAD, "pass")
    other, _ = run_both(runner, AHEAD, "print('hello')")
    assert one.ticks.x.tolist() == other.ticks.x.tolist()
    assert one.sha256 != other.sha256


BUSY, SLEEPS, FLOOD = "while True: pass", "import select\nselect.select([], [], [])", "while True: print('x' * 1000)"
CRASH, DEEP, ENDLESS = "1 / 0", "def f(): f()\nf()", "import time\nwhile True: time.sleep(1)"
SILENT, HUNGRY = "import os\nos._exit(0)", "x = 'x' * 10**9"
TALKS = "import time\nfor i in range(20):\n    print('PY::' + str(i))\n    time.sleep(0.1)\n"
SHORT = ChildLimits(0.4, 128 << 20)
VERDICTS = {
    BUSY: {Verdict.CPU_LIMIT},
    FLOOD: {Verdict.OUTPUT_LIMIT, Verdict.CPU_LIMIT},
    CRASH: {Verdict.PROGRAM_ERROR},
    DEEP: {Verdict.PROGRAM_ERROR},
    ENDLESS: {Verdict.TIME_LIMIT},
    SILENT: {Verdict.PROGRAM_ERROR},
    HUNGRY: {Verdict.MEMORY_LIMIT},
}


@pytest.mark.parametrize("second", [False, True], ids=["first", "second"])
@pytest.mark.parametrize("text", VERDICTS)
def test_one_that_goes_wrong_does_not_stop_the_other(runner: TrialRunner, text: str, second: bool) -> None:
    both = run_both(runner, *((AHEAD, text) if second else (text, AHEAD)), seconds=5, program_limits=SHORT)
    good, bad = both if second else reversed(both)
    assert (good.verdict, good.faults) == (Verdict.FINISHED, ())
    assert good.end_t == pytest.approx(2.1, abs=0.05)
    assert bad.verdict in VERDICTS[text]
    assert {fault.who for fault in bad.faults} == {"second program" if second else "program"}
    assert decide_verdict(both[0]) is bad.verdict


@pytest.mark.parametrize(
    ("first", "second"),
    [(BUSY, BUSY), (CRASH, CRASH), (FLOOD, BUSY), (ENDLESS, ENDLESS), (HUNGRY, SILENT)],
)
def test_when_both_go_wrong_both_are_told_and_the_earliest_counts(runner: TrialRunner, first: str, second: str) -> None:
    both = run_both(runner, first, second, seconds=5, program_limits=SHORT)
    for text, recording in zip((first, second), both, strict=True):
        assert recording.verdict in VERDICTS[text]
    faults = collect_faults(both[0])
    assert [fault.t for fault in faults] == sorted(fault.t for fault in faults)
    assert decide_verdict(both[0]) is faults[0].verdict


def test_two_that_wait_for_each_other_for_ever_end_when_the_time_is_up(runner: TrialRunner) -> None:
    began = time.process_time()
    first, second = run_both(runner, LISTEN, LISTEN, seconds=60)
    assert (first.verdict, second.verdict) == (Verdict.TIME_LIMIT, Verdict.TIME_LIMIT)
    assert (first.end_t, second.end_t, len(first.ticks), len(second.ticks)) == (60, 60, 1800, 1800)
    assert time.process_time() - began < 20


@pytest.mark.long
@pytest.mark.parametrize(("first", "second"), [(SLEEPS, TALKS), (TALKS, SLEEPS), (SLEEPS, SLEEPS)])
def test_one_that_sleeps_in_real_time_is_cut_and_the_other_goes_on(
    runner: TrialRunner, first: str, second: str
) -> None:
    both = run_both(runner, first, second, seconds=5)
    for text, recording in zip((first, second), both, strict=True):
        assert recording.verdict is not Verdict.FINISHED if text == SLEEPS else recording.end_t == pytest.approx(2.0)


@pytest.mark.parametrize("flood", ["PY::" + "x" * 5000, "IMG_DATA"])
def test_what_one_sends_the_other_without_end_is_paid_for(runner: TrialRunner, flood: str) -> None:
    sends = f"import time\nwhile True:\n    print('{flood}')\n    time.sleep(0.01)\n"
    first, second = run_both(runner, sends, "import time\ntime.sleep(30)", seconds=40)
    assert first.verdict is Verdict.OUTPUT_LIMIT
    assert first.end_t < 10
    assert second.end_t == 30


def test_a_given_program_may_run_on_and_has_the_same_chance_for_all(runner: TrialRunner) -> None:
    text = "import random, time\nprint(random.random())\nwhile True: time.sleep(1)"

    (first, partner), (other, others) = (
        run_both(runner, text, text, seconds=3, given=True, child_seed=seed) for seed in (1, 2)
    )
    assert partner.faults == ()
    assert (partner.end_t, decide_verdict(first)) == (3, Verdict.TIME_LIMIT)
    assert printed(partner) == printed(others)
    assert printed(first) != printed(other)


class Beats:
    """A heartbeat that cancels the job after a number of calls."""

    def __init__(self, most: int) -> None:
        self.left = most

    def __call__(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise Cancelled("that will do")


@pytest.mark.parametrize("most", [0, 1, 2, 5])
@pytest.mark.parametrize("programs", [(BUSY, TALKS), (TALKS, BUSY), (BUSY, BUSY)])
def test_a_job_that_is_cancelled_leaves_nothing_running(
    runner: TrialRunner, most: int, programs: tuple[str, str]
) -> None:
    with pytest.raises(Cancelled):
        run_both(runner, *programs, meter=JobMeter(heartbeat=Beats(most)))
    first, _ = run_both(runner, AHEAD, "pass")
    assert first.verdict is Verdict.FINISHED


def test_children_that_live_beside_each_other_outlive_the_turn_of_their_zygote(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("responders.sandbox.zygote._RECYCLE_AFTER", 1)
    with TrialRunner() as fresh:
        for _ in range(3):
            first, second = run_both(fresh, AHEAD, AHEAD)
            assert (first.verdict, second.verdict) == (Verdict.FINISHED, Verdict.FINISHED)


@pytest.mark.parametrize("number", [1, 2])
def test_what_our_own_code_stumbles_over_is_held_against_the_one_that_caused_it(
    runner: TrialRunner, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    move = World.move

    def stumbles(world: World) -> bool:
        if world.clock == 20 and (world.pose.x < 1000) == (number == 1):
            raise ZeroDivisionError("oops")
        return move(world)

    monkeypatch.setattr(World, "move", stumbles)
    both = run_both(runner, AHEAD, AHEAD)
    stumbled, other = both if number == 1 else reversed(both)
    assert stumbled.verdict is Verdict.SANDBOX_VIOLATION
    assert "ZeroDivisionError" in stumbled.faults[0].staff
    assert (other.verdict, other.end_t) == (Verdict.FINISHED, pytest.approx(2.1, abs=0.05))
