"""Packed acts of a robot program: for any bytes, the worker reads valid acts or refuses."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from responders import packets
from responders.packets import LineChange, MotorCommand, SensorRead, Wait
from responders.wire import MAX_FRAME_BYTES, MAX_UNITS, WireError
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import SENSORS, Pose

Raw = tuple[int, int, int, int, float]


def _packet(*acts: Raw, number: int = 7) -> bytes:
    return struct.pack("<BxHxxxxQ", 0, len(acts), number) + b"".join(struct.pack("<BBBBd", *act) for act in acts)


def test_acts_come_in_order_with_the_number_of_their_packet() -> None:
    data = _packet((0, 1, 0, 0, 2.0), (2, 0, 1, 3, -25.5), (2, 1, 0, 2, 0.0), (1, 0, 0, 0, 100_000.0))
    assert packets.read_header(data) == (len(data), 7)
    assert packets.unpack_actions(data) == [
        (SensorRead("right"), 2),
        (MotorCommand("outB", "speed_sp", "run-forever"), -25.5),
        (MotorCommand("outC", "", "reset"), 0),
        (Wait(), 100_000),
    ]


@pytest.mark.parametrize(
    "act",
    [
        (0, len(SENSORS), 0, 0, 1.0),
        (0, 0, 0, 0, 0.0),
        (0, 0, 0, 0, 3.0),
        (0, 0, 0, 0, 1.5),
        (0, 0, 0, 0, math.nan),
        (0, 0, 1, 0, 1.0),
        (0, 0, 0, 1, 1.0),
        (1, 0, 0, 0, -1.0),
        (1, 0, 0, 0, 0.5),
        (1, 0, 0, 0, math.inf),
        (1, 0, 0, 0, math.nan),
        (1, 0, 0, 0, 2.0 * MAX_UNITS),
        (1, 1, 0, 0, 1.0),
        (2, 2, 1, 0, 1.0),
        (2, 0, 5, 0, 1.0),
        (2, 0, 0, 8, 1.0),
        (2, 0, 1, 0, math.nan),
        (2, 0, 1, 0, -math.inf),
        (3, 0, 0, 0, -1.0),
        (3, 0, 0, 0, 1.5),
        (3, 0, 0, 0, 2.0**41),
        (3, 1, 0, 0, 1.0),
        (4, 0, 0, 0, 0.0),
        (255, 255, 255, 255, 0.0),
    ],
)
def test_an_act_that_no_honest_program_does_is_refused(act: Raw) -> None:
    with pytest.raises(WireError):
        packets.unpack_actions(_packet((0, 0, 0, 0, 1.0), act))


@pytest.mark.parametrize("count", [0, MAX_FRAME_BYTES // 12 + 1, 65_535])
def test_a_packet_is_neither_empty_nor_longer_than_a_line_may_be(count: int) -> None:
    with pytest.raises(WireError, match=f"a packet of {count} acts"):
        packets.read_header(struct.pack("<BxHxxxxQ", 0, count, 0))


@given(st.binary(min_size=12, max_size=240).map(lambda data: data[: len(data) // 12 * 12]))
def test_any_bytes_are_acts_or_refused(data: bytes) -> None:
    try:
        acts = packets.unpack_actions(bytes(16) + data)
    except WireError:
        return
    for act in acts:
        match act:
            case SensorRead(what), times:
                assert (what in SENSORS, times in (1, 2)) == (True, True)
            case Wait(), units:
                assert (units % 1, 0 <= units <= MAX_UNITS) == (0, True)
            case MotorCommand(port, _, _), value:
                assert (port in ("outB", "outC"), math.isfinite(value)) == (True, True)
            case LineChange(), lines:
                assert (lines % 1, 0 <= lines <= 2**40) == (0, True)
            case _:
                pytest.fail(f"no act: {act}")


def test_a_motor_is_told_whatever_can_be_told(runner: TrialRunner) -> None:
    """Every set point and command of the brick, both ways: the robot reads back the values that it has set."""
    program = """
motor = tank_drive.left_motor
motor.position_sp = 123
motor.speed_sp = -45
motor.position = 67
print(motor.position_sp, motor.speed_sp, motor.position, motor.polarity)
motor.polarity = "inversed"
for command in ("run-direct", "run-timed", "run-to-rel-pos", "run-to-abs-pos", "reset", "stop", "run-forever"):
    motor.command = command
print(motor.polarity, motor.state)
try:
    motor.command = "fly"
except ValueError as error:
    print(error)
try:
    motor.position_sp = 10 ** 400
except OverflowError as error:
    print("too large")
"""
    recording = run_program(runner, program, Pose(1000, 500, 0))
    assert [line.text for line in recording.printed] == [
        "123 -45 67 normal",
        "inversed running",
        "a motor has no command 'fly': expected one of reset, run-forever, run-timed, run-to-rel-pos, "
        "run-to-abs-pos, run-direct",
        "too large",
    ]


def test_thousands_of_acts_without_a_question_arrive(runner: TrialRunner) -> None:
    program = "for n in range(9000): tank_drive.on(n % 50, 10)\nfrom time import sleep\nsleep(0.1)\nprint('there')"
    recording = run_program(runner, program, Pose(1000, 500, 0))
    assert [line.text for line in recording.printed] == ["there"]
    assert recording.faults == ()


def test_a_recording_has_the_lines_that_the_program_came_to(runner: TrialRunner) -> None:
    program = "def ahead():\n    tank_drive.on_for_seconds(20, 20, 1)\nahead()\nsay('there')\nahead()"
    # Before the program begins, the kit resets the motors outside its lines.
    places = [each for each in run_program(runner, program, Pose(1000, 500, 0)).places if each.outer]
    assert [(line, outer) for _, line, outer in places] == [(2, 3), (4, 4), (2, 5)]
    assert [round(t) for t, _, _ in places][:2] == [0, 1]


def test_lines_are_complete_or_missing(runner: TrialRunner) -> None:
    program = "tank_drive.on_for_seconds(20, 20, 1)\nfor n in range(COUNT): print(n)"
    recordings = [run_program(runner, program.replace("COUNT", count), Pose(1000, 500, 0)) for count in ("9", "6000")]
    assert [[line for _, line, outer in each.places if outer] for each in recordings] == [[1, 2], []]


def test_a_busy_loop_is_named_though_acts_are_held_back(runner: TrialRunner) -> None:
    recording = run_program(runner, "tank_drive.on(10, 10)\nwhile True:\n    pass", Pose(1000, 500, 0))
    assert [fault.line for fault in recording.faults] in ([2], [3])
