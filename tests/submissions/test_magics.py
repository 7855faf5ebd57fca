"""The magics' flags: ranges, spec and side effects are the original's, and surprising ones are reported."""

from __future__ import annotations

import pytest

from sim.errors import UsageError
from sim.recording import Pose
from submissions.magics import (
    Flags,
    comment_out_magic,
    parse_flags,
    parse_magic,
    split_program,
)
from submissions.simulator_page import SimulatorPage, SimulatorSettings, apply_flags

pytestmark = pytest.mark.fast

#: Every flag of the original's magics (robolab section 8), except --help and --previewcode.
LETTERS = {
    "s": "sim",
    "b": "background",
    "r": "robotSetup",
    "o": "obstacles",
    "x": "xpos",
    "y": "ypos",
    "a": "angle",
    "u": "ultrasound",
    "p": "pendown",
    "P": "pencolor",
    "C": "clear",
    "q": "quiet",
    "c": "chart",
    "O": "output",
    "A": "array",
    "z": "noisecontrols",
    "Z": "settings",
    "X": "positioning",
    "D": "code",
    "i": "instrumentation",
    "W": "world",
    "H": "hide",
    "R": "autorun",
    "v": "preview",
    "N": "sensornoise",
    "M": "motornoise",
    "L": "collab",
    "S": "stop",
    "m": "move",
    "F": "refresh",
}
POSES = [
    ("", (200, 800, 0)),
    ("-b Loop", (500, 500, 90)),
    ("-b Simple_Shapes --collab -ARO -x 520 -y 900", (520, 900, 0)),
    ("--collab -ARO -x 200 -y 900", (200, 900, 0)),
    ("-b Square -x 550 -y 300 -a -90", (550, 300, 0)),
    ("-b Square", (550, 300, -90)),
    ("-a 400", (200, 800, 360)),
    ("-x -1180 -y 150 -a 90", (0, 150, 90)),
    ("-x 99999", (2362, 800, 0)),
    ("-b Lollipop", (750, 375, -180)),
    ("-b Lollipop -x 700", (700, 375, 0)),
    ("-b Lollipop -N 10", (750, 375, 0)),
    ("-b Lollipop -M 10", (750, 375, -180)),
    ("-b Loop -x 100", (100, 500, 90)),
    ("-r Small_Robot", (200, 943, 0)),
    ("-r Small_Robot -b Loop", (500, 500, 90)),
    ("-b Nowhere", (100, 800, 0)),
    ("--background=Loop --angle=45", (500, 500, 45)),
    ("--back Loop --ang 45 -x=7", (7, 500, 45)),
    ("-b Lollipop -m", (750, 375, 0)),
    ("-b Square -x 550 -m", (550, 300, 0)),
]


@pytest.mark.parametrize(("flags", "pose"), POSES)
def test_pose(flags: str, pose: tuple[float, float, float]) -> None:
    chosen = apply_flags(parse_magic(f"%%sim_magic {flags}")).pose
    assert (chosen.x, chosen.y, chosen.heading) == pose


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ("-b Square -a -90", "-a -90 becomes 0"),
        ("-b Nowhere", "Empty_Map is used"),
        ("-r Tank", "Default_Robot is used"),
        ("-b Lollipop -N 10", "-N also turns the robot to 0 degrees"),
        ("-b Lollipop -x 700", "turns the robot to 0 degrees"),
        ("-N 500", "becomes 128"),
        ("-o Maze", "stay as they are"),
        ("-b Obstacles_Test -o None", "-o None leaves the obstacles as they are"),
        ("-P blue", "-P blue is not a pen colour; expected one of red, orange, green"),
        ("-b Radial_grey", "also sets the light sensors 60 mm to either side"),
        ("-b Radial_grey -N 10", "-N and -M do nothing after -b Radial_grey"),
    ],
)
def test_a_flag_that_does_not_mean_what_it_says_is_pointed_out(flags: str, words: str) -> None:
    assert any(words in note for note in apply_flags(parse_magic(f"%%sim_magic {flags}")).notes)


def test_single_letters_stand_together_and_the_rest_is_read() -> None:
    flags = parse_magic("%%sim_magic_preloaded -pROHW --collab -N10 -o Wall")
    chosen = apply_flags(flags)
    assert chosen.pen_down
    assert chosen.collaborative
    assert chosen.light_noise == 10
    assert chosen.obstacles == ((1500, 200, 200, 800),)


@pytest.mark.parametrize(
    "line",
    [
        "%%sim_magics -b Loop",
        "%%sim_magic -j",
        "%%sim_magic --nope",
        "%%sim_magic -x",
        "%%sim_magic loop",
        "%%sim_magic 'x",
        "%%sim_magic --s 1",
        "%%sim_magic_preloaded -F",
        "%%sim_magic_imports -m",
        "%%sim_magic --previewcode",
        "%%sim_magic " + 1000 * "-h ",
    ],
)
def test_a_line_that_cannot_be_read_is_refused_in_one_sentence(line: str) -> None:
    with pytest.raises(UsageError, match=r"^line 1: .+") as caught:
        parse_magic(line)
    assert "\n" not in str(caught.value)


def test_a_number_that_is_none_is_refused() -> None:
    with pytest.raises(UsageError, match="whole number between 0 and 2362"):
        apply_flags(parse_magic("%%sim_magic -x 10.5"))


def test_the_magic_line_keeps_its_place_and_chooses_the_preamble() -> None:
    flags, text = split_program("%%sim_magic_imports -b Loop\nprint(1)\n")
    assert text == "#\nprint(1)\n"
    assert (flags.preamble, flags.values) == ("imports", {"b": "Loop"})
    assert split_program("print(1)")[0].preamble == "preloaded"


@pytest.mark.parametrize("before", ["", "\n", "# Ada, 2nd try\n\n", "\ufeff", "\r\n"])
def test_the_magic_line_may_follow_blank_lines_and_comments(before: str) -> None:
    flags, text = split_program(f"{before}%%sim_magic_imports\t-b\tLoop\r\nprint(1)\n")
    assert (flags.preamble, flags.values) == ("imports", {"b": "Loop"})
    assert "%" not in text
    assert text.split("\n").index("print(1)") == before.count("\n") + 1


def test_a_magic_below_the_first_statement_is_left_for_python_to_refuse() -> None:
    program = "x = 1\n%%sim_magic -b Loop\n"
    assert split_program(program) == (Flags(), program)


def test_a_refused_line_is_named_by_its_number_and_is_none_of_the_program() -> None:
    program = "\n%%sim_magic --nope\nprint(1)"
    with pytest.raises(UsageError, match=r"^line 2: there is no flag --nope"):
        split_program(program)
    assert comment_out_magic(program) == "\n#\nprint(1)"


@pytest.mark.parametrize("line", ["%", "%%", "%% ", "%%\u00a0", "% %"])
def test_a_magic_without_a_name_is_refused(line: str) -> None:
    with pytest.raises(UsageError, match=r"^line 1: "):
        split_program(line)


def test_a_blank_between_the_percent_signs_is_what_is_told() -> None:
    with pytest.raises(UsageError, match=r"^line 1: there is a blank .*; expected %%sim_magic$"):
        split_program("% %sim_magic -b Loop\nprint(1)\n")


def pages(*lines: str) -> list[SimulatorSettings]:
    """Return the state of one simulator after each of several magics."""
    simulator = SimulatorPage()
    return [simulator.apply(parse_flags("sim_magic", line)) for line in lines]


def test_what_a_flag_sets_stays_and_switches_do_not() -> None:
    first, second, third = pages("-b Loop -N 10 -M 20 -o Wall -p -L", "-x 100", "-b Square")
    assert (first.pen_down, first.collaborative) == (True, True)
    assert (second.pen_down, second.collaborative, second.background) == (False, False, "Loop")
    assert (second.light_noise, second.motor_noise, second.obstacles) == (10, 20, ((1500, 200, 200, 800),))
    # Choosing a floor clears the obstacles, but not the noise.
    assert (third.obstacles, third.light_noise) == ((), 10)


def test_choosing_a_robot_forgets_the_noise() -> None:
    _, second = pages("-N 10 -M 20", "-r Small_Robot")
    assert (second.light_noise, second.motor_noise, second.robot) == (0, 0, "Small_Robot")


def test_noise_does_nothing_on_radial_grey_until_a_robot_is_chosen() -> None:
    first, second, third = pages("-b Radial_grey -N 10 -M 20", "-r Default_Robot -N 10", "-b Loop")
    assert (first.robot, first.light_noise, first.motor_noise) == ("Default_Robot_Wide_Eyes", 0, 0)
    assert (second.robot, second.light_noise) == ("Default_Robot", 10)
    assert third.robot == "Default_Robot"
    assert pages("-b Radial_grey", "-b Loop")[1].robot == "Default_Robot"
    assert "Default_Robot is used" in pages("-r Default_Robot_Wide_Eyes")[0].notes[0]


@pytest.mark.parametrize(
    ("line", "robot"),
    [
        ("-r Small_Robot -b Radial_grey", "Small_Robot_Widest_Eyes"),
        ("-b Radial_grey -r Small_Robot_Wide_Eyes", "Small_Robot_Widest_Eyes"),
        ("-r Sensor_Diameter_Config -b Radial_grey", "Sensor_Diameter_Config_Wide_Eyes"),
        ("-r Small_Robot_Widest_Eyes", "Default_Robot"),
    ],
)
def test_radial_grey_widens_the_eyes_of_the_robot_that_was_chosen(line: str, robot: str) -> None:
    first, second = pages(line, "-b Loop")
    assert first.robot == robot
    assert second.robot == robot.partition("_Wide")[0] or second.robot == "Small_Robot_Wide_Eyes"


def test_a_program_below_wrappers_is_found_with_its_lines_in_their_places() -> None:
    text = "# driven\n%%capture\n%%time\n%%sim_magic_preloaded -b Loop\nsay('x')"
    flags, program = split_program(text)
    assert flags.values == {"b": "Loop"}
    assert program == "# driven\n#\n#\n#\nsay('x')"


def test_a_robot_that_was_left_somewhere_stays_there_until_it_is_placed() -> None:
    simulator = SimulatorPage()
    simulator.set_pose(Pose(321.5, 234.49, -45.25))
    assert simulator.apply(Flags()).pose == Pose(321.5, 234.49, -45.25)
    # The sliders follow the robot in whole numbers. The slider of the angle does not follow.
    assert simulator.apply(parse_flags("sim_magic", "-y 5")).pose == Pose(322, 5, 0)


def test_run_takes_every_flag_of_the_magics_but_the_assignments_letter() -> None:
    from service.command_line import load_command

    options = {name for option in load_command("run").params for name in option.opts}
    assert {f"-{letter}" for letter in LETTERS} - options == {"-a"}
    assert {f"--{name}" for name in LETTERS.values()} <= options
