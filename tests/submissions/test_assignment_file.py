"""Assignment files: the result of reading them, and every mistake reported with its line."""

from __future__ import annotations

import errno
import pickle
import re
from collections import Counter
from decimal import Decimal
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.errors import AssignmentError, UsageError
from sim.floors import HEIGHT, WIDTH
from sim.recording import Pose
from submissions.assignment.assignment_parts import build_assignment
from submissions.assignment.definition import Reruns
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.assignment.problems import AssignmentProblems, Problems, find_lines, find_nearest_line
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.criteria.classification import Classification
from submissions.criteria.ending import Finishes

pytestmark = pytest.mark.fast

HEAD = 'id = "a"\ntitle = "A"\n'
SCENARIO = '[[scenario]]\nid = "s"\nposes = [[100, 800, 0]]\n'
INFRARED = 'channel = {{ link = "infrared", beacon = {} }}\n'
POST = HEAD + '[world]\nobstacles = "Central_post"\n'
FINISHES = '[[criterion]]\ntitle = "Ends"\nmarks = 1\ncheck = "finishes"\n'
LAP = (
    FINISHES.replace("finishes", "laps")
    + 'id = "lap"\nline = { on = "Thruxton_Circuit" }\nstart_line = [1, 2, 3, 4]\n[[criterion]]\ntitle = "F"\n'
)
RANKING = 'marks = 1\ncheck = "ranking"\nof = "lap"\nmeasure = "lap time"\nsteps = [[50, 1]]\n'


def written(folder: Path, text: str, **files: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "assignment.toml").write_text(text)
    for name, content in files.items():
        (folder / name.replace("_py", ".py")).write_text(content)
    return folder


def problems(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(AssignmentError) as error:
        read_assignment(written(folder, text))
    assert isinstance(error.value, AssignmentProblems)
    assert str(error.value) == "\n".join(error.value.problems)
    for problem in error.value.problems:
        assert re.match(rf"{folder.name}/assignment\.toml:\d+: ", problem)
        assert "expected" in problem
    return error.value.problems


@pytest.mark.parametrize("name", list_catalogue_ids())
def test_catalogue_is_in_order(name: str) -> None:
    assignment = find_assignment(name)
    assert assignment.id == name
    assert assignment.max_marks > 0
    assert assignment.description
    assert re.fullmatch("[0-9a-f]{64}", assignment.version)
    part_texts = {"robot.py": assignment.parts.program, "responder.py": assignment.parts.responder}
    part_texts["robot2.py"] = assignment.parts.second_program
    starter = {path.name for path in (locate_assignment_folder(name) / "starter").iterdir()}
    assert {part for part, who in part_texts.items() if who == "student"} <= starter or starter == {"notebook.ipynb"}


def test_shape_recognition_covers_the_six_shapes_and_gives_the_network() -> None:
    assignment = find_assignment("shape-recognition")
    trials = [trial for trial in assignment.trials() if trial.scenario.id == "each-shape"]
    assert [trial.pose for trial in trials] == [Pose(200 + 80 * k, 900, 0) for k in range(6)]
    assert len(assignment.given["mlp_shapes_14x14.joblib"]) > 10_000
    assert all(
        "right triangle" in c.aliases["right facing triangle"]
        for c in assignment.criteria
        if isinstance(c, Classification)
    )


def test_random_start_is_drawn_evenly_and_alike_for_everybody(tmp_path: Path) -> None:
    poses = ", ".join(f"[{200 + 80 * k}, 900, 0]" for k in range(6))
    text = f'{HEAD}[[scenario]]\nid = "s"\nposes = [{poses}]\nchoose = "random"\ntrials = 600\n{FINISHES}'
    first = [trial.pose for trial in read_assignment(written(tmp_path / "a", text)).trials()]
    again = [trial.pose for trial in read_assignment(written(tmp_path / "b", text)).trials()]
    assert first == again
    counts = Counter(pose.x for pose in first)
    assert sorted(counts) == [200 + 80 * k for k in range(6)]
    assert all(70 < count < 130 for count in counts.values())


def test_everything_that_may_be_written_is_read(tmp_path: Path) -> None:
    text = """
id = "a"
title = "A"
given = ["data.csv"]
given_models = { "net.joblib" = "shapes" }

[world]
background = "Simple_Shapes"
labels = false
obstacles = "Central_post"
robot = "Small_Robot"

[parts]
program = "robot.py"
responder = "student"

[limits]
program_cpu = 1.5
output_bytes = 2000

[[scenario]]
id = "one"
poses = [[100, 800, 0], [1, 2.5, -90]]
trials = 2
seconds = 12.5
light_noise = [0, 10]
motor_noise = 5
channel = { delay = 0.2, loss = 0.1 }
visibility = "hidden"

[[scenario]]
id = "own-pose"

[[criterion]]
title = "Ends, and soon!"
marks = 0.1
check = "finishes"
seconds = 3
scenarios = ["one"]
"""
    folder = written(tmp_path / "a", text, robot_py="say('x')\n")
    (folder / "data.csv").write_text("1,2\n")
    assignment = read_assignment(folder)
    assert assignment.world.obstacles == ((900, 500, 200, 200),)
    assert assignment.given_parts == {"robot.py": "say('x')\n"}
    assert sorted(assignment.given) == ["data.csv", "net.joblib"]
    assert (assignment.limits.program_cpu, assignment.limits.output_bytes) == (1.5, 2000)
    one, own = assignment.scenarios
    assert (one.light_noise, one.motor_noise, one.channel.delay, one.channel.loss) == ((0, 10), (5,), 0.2, 0.1)
    assert own.poses == (Pose(800, 400, 0),)
    assert len(list(assignment.trials())) == 2 * 2 * 2 + 1
    (criterion,) = assignment.criteria
    assert isinstance(criterion, Finishes)
    assert (criterion.id, criterion.marks) == ("ends-and-soon", Decimal("0.1"))
    assert assignment.max_marks == Decimal("0.1")


BOTH = "[reruns]\n{}\n" + SCENARIO + FINISHES


@pytest.mark.parametrize(
    ("tables", "mistake"),
    [
        (BOTH.format('halves = "yes"'), 'halves is "yes", expected true or false'),
        (
            BOTH.format("halfs = true"),
            '"halfs" is not a key of this table, expected "causes", "halves", "statements" or "reveals"',
        ),
        (BOTH.format("reveals = -1"), "reveals is -1, expected at least 0"),
        (BOTH.format("reveals = 2"), "reveals is 2, but every scenario is visible, expected a hidden scenario with it"),
        (
            '[parts]\nresponder = "none"\n' + BOTH.format("halves = true"),
            "halves is true, but students write one part, expected it with two parts from the student",
        ),
    ],
)
def test_mistakes_in_reruns(tmp_path: Path, tables: str, mistake: str) -> None:
    (problem,) = problems(tmp_path / "a", HEAD + tables)
    assert mistake in problem


def test_reruns_are_read_and_show_neither_halves_nor_hidden_causes_by_default(tmp_path: Path) -> None:
    assert read_assignment(written(tmp_path / "a", HEAD + SCENARIO + FINISHES)).reruns == Reruns()
    hidden = SCENARIO + 'visibility = "hidden"\n'
    text = HEAD + "[reruns]\ncauses = false\nhalves = true\nreveals = 3\n" + hidden + FINISHES
    assert read_assignment(written(tmp_path / "b", text)).reruns == Reruns(causes=False, halves=True, reveals=3)


def test_version_follows_every_file(tmp_path: Path) -> None:
    text = HEAD + SCENARIO + FINISHES
    first = read_assignment(written(tmp_path / "a", text)).version
    assert read_assignment(written(tmp_path / "b", text)).version == first
    assert read_assignment(written(tmp_path / "a", text, notes="x")).version != first
    assert read_assignment(written(tmp_path / "b", text + "\n")).version != first


def test_all_mistakes_are_found_in_one_go(tmp_path: Path) -> None:
    text = """\
id = "Not A Slug"
title = 3
given = ["no.csv", "../x"]
colour = "red"
[world]
backgroud = "Loop"
robot = "Fast_Robot"
[parts]
program = "robot.py"
[limits]
program_cpu = "2"
[[scenario]]
id = "s"
poses = [
    [100, 800, 0],
    [100, 1800, 0],
    [100, 800],
]
[[scenario]]
id = "s"
trials = 0
light_noise = [0, 500]
[[scenario]]
id = "t"
poses = [
    [100, 800, 0],
    [100, 1800, 0],
]
[[criterion]]
title = "x"
marks = -1
check = "finishes"
[[criterion]]
title = "x"
marks = 1
check = "finish"
[[criterion]]
title = "x"
marks = 1
check = "says"
matches = "("
at_leest = 1
scenarios = ["s", "tt"]
[[criterion]]
title = "x"
marks = 1.005
check = "pose"
"""
    messages = problems(tmp_path / "bad", text)
    by_line: dict[int, list[str]] = {}
    for problem in messages:
        line, _, sentence = problem.removeprefix("bad/assignment.toml:").partition(": ")
        by_line.setdefault(int(line), []).append(sentence)
    expected = {
        1: "small letters",
        2: "title is 3, expected a text in quotes",
        3: 'given names "',
        4: '"colour" is not a key here',
        6: 'did you mean "background"?',
        7: 'expected "Default_Robot"',
        9: 'program is "robot.py", expected "student" or a .py file beside this file',
        11: 'program_cpu is "2", expected a number',
        17: "poses[2] has too few numbers, expected [x, y, heading]",
        20: 'id "s" is the id of an earlier scenario',
        21: "trials is 0, expected at least 1",
        22: "light_noise has 500 in it, expected numbers from 0 to 128",
        27: "poses[1] is off the floor",
        31: "marks is -1, expected at least 0",
        36: 'did you mean "finishes"?',
        41: "matches is not a regular expression",
        42: 'did you mean "at_least"?',
        43: 'scenarios names "tt", expected the id of a scenario',
        46: "marks is 1.005, expected at most two decimal places",
    }
    for number, phrase in expected.items():
        assert any(phrase in sentence for sentence in by_line.get(number, [])), (number, messages)
    assert set(by_line) == set(expected)


@pytest.mark.parametrize(
    ("text", "line", "phrase"),
    [
        ("", 1, "there is no [[scenario]]"),
        (HEAD + SCENARIO, 1, "there is no [[criterion]]"),
        (HEAD.replace('title = "A"', "") + SCENARIO + FINISHES, 1, "title is missing"),
        (HEAD + "[scenario]\nid = 1\n" + FINISHES, 3, "expected [[scenario]] before each"),
        (HEAD + SCENARIO + FINISHES.replace('check = "finishes"\n', ""), 6, "check is missing"),
        (HEAD + SCENARIO + FINISHES + 'id = "e"\n' + FINISHES + 'id = "e"\n', 15, "id of an earlier criterion"),
        (HEAD + '[world]\nbackground = "Looop"\n' + SCENARIO + FINISHES, 4, 'did you mean "Loop"?'),
        (HEAD + '[world]\nbackground = "mine.png"\n' + SCENARIO + FINISHES, 4, "image beside this file"),
        (HEAD + '[world]\nobstacles = "Post"\n' + SCENARIO + FINISHES, 4, "Central_post"),
        (HEAD + "[world]\nobstacles = [[1, 2, 3]]\n" + SCENARIO + FINISHES, 4, "[x, y, width, height]"),
        (HEAD + 'given_models = { "n.joblib" = "shape" }\n' + SCENARIO + FINISHES, 3, 'did you mean "shapes"?'),
        (HEAD + '[world]\nrobot = "Smal_Robot"\n' + SCENARIO + FINISHES, 4, 'did you mean "Small_Robot"?'),
        (
            HEAD + '[world]\nbackground = "Looop"\nrobot = "Smal_Robot"\n' + SCENARIO + FINISHES,
            4,
            'background is "Looop"',
        ),
        (HEAD + '[world]\nsheet = "per-seed"\n' + SCENARIO + FINISHES, 4, "Empty_Map is not drawn from a seed"),
        (HEAD + SCENARIO.replace("[[100, 800, 0]]", "[100, 800, 0]") + FINISHES, 5, "[[x, y, heading], ...]"),
        (HEAD + SCENARIO + 'motor_noise = "10"\n' + FINISHES, 6, "expected a number or a list of numbers"),
        (HEAD + '[world]\nnoise = "both"\n' + SCENARIO + FINISHES, 4, 'expected "course" or "both directions"'),
        (
            HEAD + SCENARIO + FINISHES.replace("finishes", "timing") + "between = [3, 2]\n",
            10,
            "between is an empty range",
        ),
        (
            HEAD + SCENARIO + FINISHES.replace("finishes", "reports") + 'expected = [["a"], ["b"]]\n',
            10,
            'expected has 2 lists for the 1 poses of scenario "s"',
        ),
        (
            HEAD + SCENARIO + LAP + RANKING.replace("lap time", "laptime"),
            18,
            'measure is "laptime", which "lap" (laps) does not measure, expected one of "lap time", "laps", '
            '"farthest off" or "part of a lap"; did you mean "lap time"?',
        ),
        (HEAD + SCENARIO + LAP + RANKING.replace('of = "lap"', 'of = "lapp"'), 17, 'did you mean "lap"?'),
        (
            HEAD
            + SCENARIO
            + FINISHES.replace("finishes", "source")
            + 'id = "lap"\nuses = ["while"]\n[[criterion]]\ntitle = "F"\n'
            + RANKING,
            17,
            'which "lap" (source) does not measure, expected one that has figures',
        ),
        (
            HEAD + SCENARIO + FINISHES.replace("finishes", "timing") + 'of = "movin"\nbetween = [1, 2]\n',
            10,
            'of is "movin", expected "program", "moving" or "speech"; did you mean "moving"?',
        ),
        (HEAD + SCENARIO + FINISHES + "id = one\n", 10, "texts need quotes"),
        (HEAD + SCENARIO + FINISHES + "marks = 2\n", 10, "this key is given twice"),
        (HEAD + SCENARIO + "channel = { los = 1 }\n" + FINISHES, 6, 'did you mean "loss"?'),
        (HEAD + SCENARIO + "channel = { loss = 1.5 }\n" + FINISHES, 6, "expected at most 1"),
        (HEAD + SCENARIO + "channel = { facing = 90 }\n" + FINISHES, 6, "facing and no link that it limits, expected"),
        (HEAD + SCENARIO + 'channel = { link = "infrared" }\n' + FINISHES, 6, "expected beacon = [x, y] beside it"),
        (HEAD + SCENARIO + INFRARED.format("[3000, 50]") + FINISHES, 6, "has a beacon off the floor, expected"),
        (HEAD + SCENARIO + INFRARED.format("[100]") + FINISHES, 6, "too few numbers, expected [x, y]"),
        (POST + SCENARIO + INFRARED.format("[1000, 510]") + FINISHES, 8, "beacon is in an obstacle, which blocks"),
        (HEAD + SCENARIO + FINISHES.replace("finishes", "in_reach"), 9, 'expected link = "infrared" in scenario "s"'),
        (HEAD + SCENARIO + "seconds = nan\n" + FINISHES, 6, "expected a finite number"),
        (HEAD + SCENARIO + "seconds = 1979-05-27\n" + FINISHES, 6, "expected a number"),
        (HEAD + SCENARIO + "trials = true\n" + FINISHES, 6, "expected a whole number"),
        (
            HEAD + SCENARIO.replace("0]]", "0]]\ntrials = 1000\nlight_noise = [1,2,3,4,5,6]") + FINISHES,
            3,
            "too many trials",
        ),
        (
            HEAD + SCENARIO + FINISHES.replace("finishes", "classification"),
            6,
            "Empty_Map has no labels",
        ),
        (
            HEAD + SCENARIO + FINISHES.replace("finishes", "classification") + 'truth = ["a", "b"]\n',
            10,
            'truth has 2 labels for the 1 poses of scenario "s"',
        ),
        (
            HEAD + '[parts]\nresponder = "none"\n' + SCENARIO + FINISHES.replace("finishes", "replies"),
            11,
            "needs a responder",
        ),
        (HEAD + '[parts]\nprogram = "none"\n' + SCENARIO + FINISHES, 4, 'expected "student" or a .py file'),
        (HEAD + SCENARIO + FINISHES.replace("finishes", "prints") + "equals = []\n", 10, "is an empty list"),
        (HEAD + SCENARIO + FINISHES.replace("finishes", "prints") + "in_order = []\n", 10, "is an empty list"),
        (HEAD + SCENARIO + FINISHES.replace("finishes", "says") + 'contains = [""]\n', 10, "empty text"),
        (HEAD + SCENARIO + FINISHES + "\n[world\n", 11, "expected TOML"),
        (HEAD + SCENARIO + FINISHES + 'description = "x', 10, "expected TOML"),
        (HEAD + 'id = "b"\n', 3, "expected TOML"),
    ],
)
def test_mistake_is_named_with_its_line(tmp_path: Path, text: str, line: int, phrase: str) -> None:
    messages = problems(tmp_path / "bad", text)
    assert any(p.startswith(f"bad/assignment.toml:{line}: ") and phrase in p for p in messages), messages


@pytest.mark.parametrize("check", ["says", "prints", "messages"])
def test_criterion_that_asks_for_nothing_is_refused(tmp_path: Path, check: str) -> None:
    messages = problems(tmp_path / "bad", HEAD + SCENARIO + FINISHES.replace("finishes", check))
    assert "has no condition" in messages[0]


@pytest.mark.parametrize("poses", ["[1, 2, 3]", '[["a", 2, 3]]', "[[1, 2]]", "[[nan, 2, 3]]"])
def test_a_list_of_wrong_poses_is_not_called_too_short_as_well(tmp_path: Path, poses: str) -> None:
    messages = problems(tmp_path / "bad", HEAD + f'[[scenario]]\nid = "s"\nposes = {poses}\n' + FINISHES)
    assert not any("too few entries" in sentence for sentence in messages)
    assert all(sentence.startswith("bad/assignment.toml:5: poses") for sentence in messages), messages


def test_what_is_no_assignment_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AssignmentError, match=r"has no assignment\.toml"):
        read_assignment(tmp_path)
    (tmp_path / "assignment.toml").write_bytes(b'id = "\xff"\n')
    with pytest.raises(AssignmentError, match=r"assignment\.toml:1: the text is not UTF-8"):
        read_assignment(tmp_path)
    (tmp_path / "assignment.toml").write_text("x = " + "[" * 5000 + "]" * 5000)
    with pytest.raises(AssignmentError, match="nested too deeply"):
        read_assignment(tmp_path)


@pytest.mark.parametrize("name", ["no-such", "a" * 300, "/" + "a" * 300, "../lollipop"])
def test_a_name_of_no_assignment_is_one_sentence(name: str) -> None:
    with pytest.raises(UsageError, match=r"^There is no assignment"):
        locate_assignment_folder(name)


def test_a_folder_that_may_not_be_read_is_not_called_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path) -> bool:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "is_dir", refuse)
    with pytest.raises(UsageError, match=r"^private/shapes cannot be read: Permission denied$"):
        locate_assignment_folder("private/shapes")


def test_assignment_is_found_by_id_and_by_path(tmp_path: Path) -> None:
    folder = written(tmp_path / "mine", HEAD + SCENARIO + FINISHES)
    assert find_assignment(folder).id == "a"
    assert find_assignment(str(folder / "assignment.toml")).id == "a"
    with pytest.raises(UsageError, match='did you mean "echo-responder"'):
        find_assignment("echo-respnder")
    (tmp_path / "task.toml").write_text("")
    with pytest.raises(UsageError, match=r"task\.toml is a file, expected"):
        find_assignment(str(tmp_path / "task.toml"))
    with pytest.raises(UsageError, match="robomark assignments list shows the catalogue"):
        find_assignment("zzz")


def test_problems_survive_a_queue() -> None:
    error = pickle.loads(pickle.dumps(AssignmentProblems(("a:1: x", "a:2: y"))))
    assert error.problems == ("a:1: x", "a:2: y")


@given(st.floats(-50, 2500), st.floats(-50, 1200))
def test_a_pose_is_accepted_exactly_when_it_is_on_the_floor(x: float, y: float) -> None:
    document = {
        "id": "a",
        "title": "A",
        "scenario": [{"id": "s", "poses": [[x, y, 0]]}],
        "criterion": [{"title": "t", "marks": 1, "check": "finishes"}],
    }
    problem_list = Problems("f", {})
    assert (build_assignment(document, {}, problem_list) is not None) == (0 <= x <= WIDTH and 0 <= y <= HEIGHT)


def test_lines_of_keys_are_found_in_every_way_of_writing_them() -> None:
    text = (
        '''\
a = 1 # [x]
"b.c".d = "[y]"
e = """
f = 1
\\""" g = 2"""
h = [ # one
  [1, "]"],

  { i = 1, j = [2,
     3] },
]
[k.l]
m = 'it'''
        + """'
n = 2021-01-01 00:00:00
[[o]]
p = 1
[[o]]
[o.q]
r = 1
[[o.s]]
t.u = 3
"""
    )
    text = text.replace("m = 'it'", "m = 'it\"'")
    lines = find_lines(text)
    expected = {
        ("a",): 1,
        ("b.c", "d"): 2,
        ("e",): 3,
        ("h", 0): 7,
        ("h", 1, "i"): 9,
        ("h", 1, "j", 1): 10,
        ("k", "l", "m"): 13,
        ("k", "l", "n"): 14,
        ("o", 0, "p"): 16,
        ("o", 1): 17,
        ("o", 1, "q", "r"): 19,
        ("o", 1, "s", 0, "t", "u"): 21,
    }
    assert {path: lines[path] for path in expected} == expected
    assert find_nearest_line(lines, ("o", 1, "q", "missing")) == 18
    assert find_nearest_line(lines, ("nowhere",)) == 1


KEYS = st.sampled_from(
    [
        "id",
        "title",
        "given",
        "given_models",
        "aliases",
        "world",
        "parts",
        "limits",
        "scenario",
        "criterion",
        "background",
        "obstacles",
        "robot",
        "program",
        "responder",
        "poses",
        "light_noise",
        "channel",
        "check",
        "marks",
        "scenarios",
        "truth",
        "in_order",
        "expect",
        "value",
        "path",
        "zone",
        "at_least",
    ]
)
VALUES = st.recursive(
    st.none().map(lambda _: "classification")
    | st.sampled_from(["says", "replies", "pose", "messages", "Loop", "student", "s", "(", ""])
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=5),
    max_leaves=20,
)


@given(st.dictionaries(KEYS, VALUES, max_size=8))
def test_whatever_a_file_says_the_answer_is_an_assignment_or_sentences(document: dict[str, object]) -> None:
    problem_list = Problems("f", {})
    assert build_assignment(document, {}, problem_list) is not None or problem_list.sorted()
