"""The magics' flags: clamps, order and side effects are the original's, and surprises are pointed out."""

from __future__ import annotations

import pytest

from sim.errors import UsageError
from submissions.magics import Flags, parse_magic, setup, split_program, without_magic

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
]


@pytest.mark.parametrize(("flags", "pose"), POSES)
def test_pose(flags: str, pose: tuple[float, float, float]) -> None:
    chosen = setup(parse_magic(f"%%sim_magic_preloaded {flags}")).pose
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
    ],
)
def test_a_flag_that_does_not_mean_what_it_says_is_pointed_out(flags: str, words: str) -> None:
    assert any(words in note for note in setup(parse_magic(f"%%sim_magic {flags}")).notes)


def test_single_letters_stand_together_and_the_rest_is_read() -> None:
    flags = parse_magic("%%sim_magic_preloaded -pROHW --collab -N10 -o Wall")
    chosen = setup(flags)
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
    ],
)
def test_a_line_that_cannot_be_read_is_refused_in_one_sentence(line: str) -> None:
    with pytest.raises(UsageError, match=r"^line 1: .+") as caught:
        parse_magic(line)
    assert "\n" not in str(caught.value)


def test_a_number_that_is_none_is_refused() -> None:
    with pytest.raises(UsageError, match="whole number between 0 and 2362"):
        setup(parse_magic("%%sim_magic -x 10.5"))


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
    assert without_magic(program) == "\n#\nprint(1)"


@pytest.mark.parametrize("line", ["%", "%%", "%% ", "%%\u00a0"])
def test_a_magic_without_a_name_is_refused(line: str) -> None:
    with pytest.raises(UsageError, match=r"^line 1: "):
        split_program(line)
