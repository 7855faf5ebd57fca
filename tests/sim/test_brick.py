"""The functions and classes available to robot programs, and their results."""

from __future__ import annotations

import pytest

from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Pose, Verdict
from sim.world import World

pytestmark = pytest.mark.fast

#: An expression, and its printed value, for a robot at (520, 900) over Simple_Shapes unless noted.
VALUES = [
    ("get_clock()", "0"),
    ("colorLeft.reflected_light_intensity", "204"),
    ("colorLeft.reflected_light_intensity_pc", "80.0"),
    ("colorRight.full_reflected_light_intensity", "66.66666666666667"),
    ("colorRight.rgb", "[170, 170, 170]"),
    ("colorRight.raw", "[170.0, 170.0, 170.0]"),
    ("colorRight.red, colorRight.green, colorRight.blue", "170 170 170"),
    ("colorRight.hsv", "[0, 0, 66]"),
    ("colorRight.hls", "[0, 66, 0]"),
    ("colorRight.lab", "[69, 0, 0]"),
    ("colorRight.color, colorRight.color_name", "6 White"),
    ("colorLeft.ambient_light_intensity", "0"),
    ("ultrasonic.distance_centimeters", "182.2"),
    ("ultrasonic.other_sensor_present", "False"),
    ("gyro.angle, gyro.rate, gyro.angle_and_rate", "0 0 [0, 0]"),
    ("tank_drive.left_motor.position", "0"),
    ("tank_drive.left_motor.state == ''", "True"),
    ("tank_drive.left_motor.is_running", "False"),
    ("tank_drive.left_motor.max_speed, tank_drive.left_motor.count_per_rot", "1050 360"),
    ("__import__('ev3dev2_glue').showme()", "okay?"),
    ("__import__('ev3dev2_glue').pyState()", "{'messages': []}"),
    ("SpeedPercent(50).to_native_units(tank_drive.left_motor)", "525.0"),
    ("__import__('ev3dev2.motor').motor.SpeedRPS(1).to_native_units(tank_drive.left_motor)", "525.0"),
    ("__import__('ev3dev2.motor').motor.SpeedDPS(360).to_native_units(tank_drive.left_motor)", "525.0"),
    ("tank_turn.get_speed_steering(100, 50)", "(525, -525)"),
    ("tank_turn.get_speed_steering(-50, 75)", "(0, 788)"),
    ("tank_turn.get_speed_steering(0, -75)", "(-787, -787)"),
]


def test_values(runner: TrialRunner) -> None:
    program = "".join(f"print({expression})\n" for expression, _ in VALUES)
    recording = run_program(runner, program, Pose(520, 900, 0), background="Simple_Shapes")
    assert recording.faults == ()
    assert dict(zip((each for each, _ in VALUES), (line.text for line in recording.printed), strict=True)) == dict(
        VALUES
    )


REFUSALS = [
    ("ColorSensor('in1')", "TypeError: No color sensor connected to in1"),
    ("ColorSensor()", "TypeError: No color sensor connected to null"),
    ("MoveTank('outA', OUTPUT_B)", "TypeError: No motor connected to outA"),
    ("tank_drive.on(150, 0)", "Exception: Invalid Speed Percentage."),
    ("SpeedPercent(101)", "ValueError: 101 is an invalid percentage"),
    ("tank_turn.on(120, 50)", "ValueError: 120 is an invalid steering"),
    ("tank_drive.on_for_seconds(50, 50, -1)", "ValueError: seconds is negative"),
    ("input('name?')", "EOFError: nobody is at the keyboard"),
    ("print 'hello'", "SyntaxError: Missing parentheses"),
    ("time.sleep(1)", "NameError: name 'time' is not defined"),
]


@pytest.mark.parametrize(("statement", "words"), REFUSALS)
def test_a_mistake_is_named_with_the_students_own_line(runner: TrialRunner, statement: str, words: str) -> None:
    recording = run_program(runner, f"\n\n{statement}\n")
    assert recording.verdict is Verdict.PROGRAM_ERROR
    assert recording.faults[0].message.startswith(words)
    assert recording.faults[0].line == 3


TIMES = [
    ("colorLeft.reflected_light_intensity", 0.01),
    ("colorLeft.color", 0.02),
    ("gyro.angle", 0.02),
    ("gyro.angle_and_rate", 0.01),
    ("colorLeft.ambient_light_intensity", 0.0),
    ("tank_drive.left_motor.position", 0.0),
    ("tank_drive.left_motor.is_running", 0.01),
    ("get_clock()", 0.0),
    ("say('one two three four five six seven eight nine ten eleven twelve thirteen', True)", 6.0),
    ("say('one two three four')", 0.0),
    ("speaker.speak('one two three four five six seven eight nine ten eleven twelve thirteen')", 6.0),
    ("__import__('time').sleep(0.25)", 0.25),
]


@pytest.mark.parametrize(("expression", "seconds"), TIMES)
def test_what_a_call_costs(runner: TrialRunner, expression: str, seconds: float) -> None:
    assert run_program(runner, expression).end_t == pytest.approx(seconds, abs=0.0101 if "True" in expression else 1e-9)


@pytest.mark.parametrize(
    ("preamble", "name", "known"),
    [("none", "say", False), ("imports", "MoveTank", True), ("imports", "say", False), ("preloaded", "say", True)],
)
def test_a_preamble_brings_its_names(runner: TrialRunner, preamble: str, name: str, known: bool) -> None:
    recording = run_program(runner, f"{name}\n", preamble=preamble)  # type: ignore[arg-type]
    assert (recording.verdict is Verdict.FINISHED) is known


def test_a_motor_left_on_at_the_end_moves_nothing(runner: TrialRunner) -> None:
    recording = run_program(runner, "tank_drive.on(50, 50)")
    assert (recording.end, len(recording.ticks)) == (recording.start, 0)


def test_simulated_time_begins_in_2020_and_moves_with_the_world(runner: TrialRunner) -> None:
    program = (
        "import time, datetime\nprint(time.time())\ntime.sleep(1.5)\n"
        "print(time.time(), time.monotonic(), datetime.datetime.now())"
    )
    first, second = (line.text for line in run_program(runner, program).printed)
    assert first == "1577836800.0"
    assert second == "1577836801.5 1.5 2020-01-01 00:00:01.500000"


def test_every_clock_agrees_with_those_of_python(runner: TrialRunner) -> None:
    program = (
        "import os, time, timeit\ntime.sleep(1.5)\n"
        "print([time.clock_gettime(each) - time.time() for each in (0, 5, 11)])\n"
        "print(time.clock_gettime_ns(0) - time.time_ns())\n"
        "print([time.clock_gettime(each) for each in (1, 2, 3, 4, 7)], time.clock_gettime_ns(1))\n"
        "print(os.times().elapsed, timeit.default_timer())"
    )
    page_text = [line.text for line in run_program(runner, program).printed]
    assert page_text == ["[0.0, 0.0, 0.0]", "0", "[1.5, 1.5, 1.5, 1.5, 1.5] 1500000000", "1.5 1.5"]


def test_generators_without_a_seed_draw_from_that_of_the_trial(runner: TrialRunner) -> None:
    program = "import random\nprint(random.Random().random(), random.seed(), random.random())"
    page_text = [run_program(runner, program, seed=seed).printed[0].text for seed in (1, 1, 2)]
    assert page_text[0] == page_text[1] != page_text[2]


@pytest.mark.parametrize("attempt", ["open('/dev/urandom', 'rb')", "os.getrandom(8)"])
def test_the_kernels_chance_is_refused(attempt: str, runner: TrialRunner) -> None:
    assert run_program(runner, f"import os\n{attempt}").verdict is Verdict.PROGRAM_ERROR


def test_chance_comes_from_the_seed(runner: TrialRunner) -> None:
    program = (
        "import random, uuid, secrets, os\nprint(random.random(), uuid.uuid4(), secrets.token_hex(4), os.urandom(4))"
    )
    page_text = [run_program(runner, program, seed=seed).printed[0].text for seed in (1, 1, 2)]
    assert page_text[0] == page_text[1] != page_text[2]


def test_nothing_leaks_from_one_run_into_the_next(runner: TrialRunner) -> None:
    run_program(runner, "import math, builtins\nmath.pi = 3\nbuiltins.left_over = 1\ntank_drive.on(50, 50)\ngyro.angle")
    recording = run_program(runner, "import math\nprint(math.pi, gyro.angle, 'left_over' in dir(__builtins__))")
    assert recording.printed[0].text == "3.141592653589793 0 False"


def test_the_datalog_is_read_from_what_is_printed(runner: TrialRunner) -> None:
    program = (
        "print('Light_left: 42 1.5')\nprint('Gyro: 7')\nprint('Color: 3')\n"
        "print('Light_left:5')\nprint('Ultrasonic: far')\n"
        "print('image_data both')\n"
    )
    recording = run_program(runner, program, background="Simple_Shapes")
    assert [(datum.name, datum.value, datum.simtime) for datum in recording.datalog] == [
        ("Light_left", 42.0, 1.5),
        ("Gyro", 7.0, None),
    ]
    assert [(side, len(csv.split(",")), tick) for side, csv, tick in recording.image_log] == [
        ("left", 1600, 0),
        ("right", 1600, 0),
    ]
    assert recording.printed[-1].text == "both image data logged..."


def test_no_image_is_rendered_unless_it_is_logged(runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(World, "render_images", lambda _: pytest.fail("an image was rendered"))
    recording = run_program(runner, "for _ in range(3):\n    print('image_data none')\n")
    assert [line.text for line in recording.printed] == ["none image data logged..."] * 3
    assert (recording.image_log, recording.faults) == ((), ())


def test_touching_a_wall_and_an_obstacle_is_recorded_and_stops_nothing(runner: TrialRunner) -> None:
    recording = run_program(
        runner, "tank_drive.on_for_seconds(100, 100, 6)", Pose(500, 600, 0), obstacles=((900, 500, 200, 200),)
    )
    assert [touch.what for touch in recording.touches] == ["obstacle 1", "right wall"]
    assert recording.end.x > 2362


def test_what_the_start_touches_already_is_no_touch(runner: TrialRunner) -> None:
    recording = run_program(runner, "tank_drive.on_for_seconds(50, 50, 1)", Pose(100, 800, 0))
    assert recording.touches == ()


@pytest.mark.parametrize(("amplitude", "low", "high"), [(0, 352.1, 352.1), (100, 300, 420)])
def test_wheel_noise(runner: TrialRunner, amplitude: float, low: float, high: float) -> None:
    from sim.world import Noise

    recording = run_program(runner, "tank_drive.on_for_seconds(50, 50, 1)", noise=Noise(motor=amplitude))
    assert low <= recording.ticks.left_position[-1] <= high
