"""Notebooks as submissions: executed from top to bottom, with one run marked, and everything else told as a note."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from command import robomark
from models import weights_bytes
from notebook_builder import MESSAGING, MESSAGING_SCRIPT, notebook
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.faults import fault_groups
from sim.errors import UsageError
from sim.recording import Recording, Verdict
from submissions.assignment.definition import Assignment, Parts
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.bundle import fit_parts, read_submission
from submissions.packed import pack_submission, unpack_submission

TOML = """
id = "drive"
title = "Drive"
[world]
background = "Simple_Shapes"
[parts]
{parts}
[[scenario]]
id = "one"
poses = [[300, 700, 0]]
seconds = 5
[limits]
responder_cpu = 1
[[criterion]]
title = "Ends"
marks = 1
check = "finishes"
"""
RESPONDER = "def responder(text):\n    return 'heard ' + text"
PROGRAM = '%%sim_magic_preloaded -b Loop -x 20 -R\nimport time\nprint("PY::hello")\ntime.sleep(1)\nsay("done")\n'


def assignment(folder: Path, parts: str = "", given: Mapping[str, str] | None = None) -> Assignment:
    (folder / "assignment.toml").write_text(TOML.format(parts=parts))
    for name, text in (given or {}).items():
        (folder / name).write_text(text)
    return read_assignment(folder)


def graded(
    folder: Path,
    runner: TrialRunner,
    cells: Sequence[str],
    parts: str = "",
    *,
    given: Mapping[str, str] | None = None,
    tags: Mapping[int, Sequence[str]] | None = None,
) -> Grade:
    asked = assignment(folder, parts, given)
    submission = read_submission(notebook(folder / "ada.ipynb", cells, tags), asked=asked.parts)
    return grade(submission, asked, runner=runner)


def recorded(folder: Path, runner: TrialRunner, cells: Sequence[str], parts: str = "") -> Recording:
    return graded(folder, runner, cells, parts).trials[0].recording


def spoken(recording: Recording) -> list[str]:
    return [line.text for line in recording.spoken]


def answers(recording: Recording) -> list[str]:
    return [message.text for message in recording.messages if message.sender == "responder"]


# The course's own notebook.


@pytest.fixture(params=["ipynb", "py"])
def messaging(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The course's notebook with its network beside it, as .ipynb and as nbconvert's .py."""
    folder = tmp_path / "ada"
    folder.mkdir()
    shutil.copy(MESSAGING if request.param == "ipynb" else MESSAGING_SCRIPT, folder / f"messaging.{request.param}")
    (folder / "mlp_shapes_14x14.joblib").write_bytes(weights_bytes("shapes"))
    return folder


@pytest.mark.parametrize(
    ("name", "cell", "marks"),
    [
        ("echo-responder", "1", 10),
        ("json-queue", "2", 10),
        ("image-parser", "3", 10),
        ("shape-recognition", "last", 12),
    ],
)
def test_the_course_notebook_gets_full_marks_for_each_of_its_programs(
    messaging: Path, runner: TrialRunner, name: str, cell: str, marks: int
) -> None:
    found = find_assignment(name)
    asked = replace(found, parts=replace(found.parts, cell=cell), scenarios=found.scenarios[:1])
    result = grade(read_submission(messaging, asked=asked.parts), asked, runner=runner)
    lost = [each for each in result.criteria if each.marks < each.max_marks and each.id != "shape-in-noise"]
    assert lost == []
    assert result.verdict is Verdict.FINISHED
    recording = result.trials[0].recording
    assert "Parsed: {'typ': 'PY', 'obj': [1, 2, 3]}" in recording.responder_output
    assert "Response: Python saw >> 4 << that..." in recording.responder_output
    assert recording.responder_log.startswith("# Responder logfile\n# ---")
    assert not any("diag" in note for note in result.notes)
    assert marks == sum(each.max_marks for each in result.criteria)


def test_both_forms_of_a_notebook_are_the_same_notebook(tmp_path: Path) -> None:
    shutil.copy(MESSAGING_SCRIPT, tmp_path / "messaging.py")
    sources = []
    for path in (MESSAGING, tmp_path / "messaging.py"):
        read = read_submission(path).notebook
        assert read is not None
        # nbconvert writes line magics as calls, and texts between cells as comments.
        code = [cell.source for cell in read.cells if cell.source.startswith("%%sim_magic")]
        sources.append((len(read.cells), [source.rstrip() for source in code]))
    assert sources[0] == sources[1]
    assert sources[0][0] == 34


def test_run_shows_every_robot_of_the_course_notebook(tmp_path: Path) -> None:
    shutil.copy(MESSAGING, tmp_path)
    command = "from service.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", command, "run", "messaging.ipynb", "-x", "360", "--picture", "p.png", "--diagrams", "d"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith("--- the robot")] == [
        f"--- the robot, started by cell {number} ---" for number in (12, 20, 25, 31, 32, 33, 34)
    ]
    assert "(says) all done" in done.stdout
    assert "(says) Is that a upwards facing triangle" in done.stdout
    # The flags of the command line are those of the last run.
    assert done.stdout.count("(says) Is that a left facing triangle") == 1
    images = [tmp_path / "p.png", *(tmp_path / "d" / f"cell-{number}.png" for number in (2, 7, 15, 27))]
    assert all(image.read_bytes().startswith(b"\x89PNG") for image in images)
    assert len(list((tmp_path / "d").iterdir())) == 4


def test_a_robot_program_draws_no_diagrams(tmp_path: Path) -> None:
    (tmp_path / "robot.py").write_text("say('hello')")
    done = robomark("run", tmp_path / "robot.py", "--diagrams", tmp_path / "d")
    assert done.returncode == 2
    assert "robot.py is not a notebook and draws no diagrams; leave --diagrams out" in done.stderr


# Which run is marked.


def test_the_scenario_places_the_marked_run_and_the_others_keep_their_flags(
    tmp_path: Path, runner: TrialRunner
) -> None:
    cells = [
        RESPONDER,
        "%%sim_magic_preloaded -b Loop -x 500 -y 400 -a 90 -R\ntank_drive.on_for_seconds(50, 50, 1)",
        "before = %sim_robot_state\nprint('left at', round(before.state['x']), round(before.state['y']))",
        "%sim_magic -R -x 100",
        "after = %sim_robot_state\nprint('left at', round(after.state['x']), round(after.state['y']))",
    ]
    recording = recorded(tmp_path, runner, cells)
    assert "left at 500 572" in recording.responder_output
    assert "left at 472 700" in recording.responder_output
    assert (recording.start.x, recording.start.y, recording.start.heading) == (300, 700, 0)
    assert recording.background == "Simple_Shapes"


def two_programs(which: str) -> str:
    return f'%%sim_magic_preloaded -R\nsay("{which}")'


def test_marked_by_tag_by_number_or_the_last(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, two_programs("one"), "x = 1", two_programs("two"), two_programs("three")]
    for cell, expected in (("2", "two"), ('"last"', "three"), ('"tag:the end"', "one")):
        result = graded(tmp_path, runner, cells, f"cell = {cell}", tags={2: ["the end"]})
        assert spoken(result.trials[0].recording) == [expected]


def test_a_program_without_autorun_is_run_when_it_is_the_marked_one(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, two_programs("one"), '%%sim_magic_preloaded\nsay("two")']
    assert spoken(recorded(tmp_path, runner, cells)) == ["two"]


@pytest.mark.parametrize(
    "cell", ["if False:\n    %sim_magic -R", "1 / 0\n%sim_magic -R", "def again():\n    %sim_magic -R"]
)
def test_a_last_program_that_is_never_come_to_gives_way_to_the_last_that_ran(
    tmp_path: Path, runner: TrialRunner, cell: str
) -> None:
    recording = recorded(tmp_path, runner, [RESPONDER, two_programs("one"), cell])
    assert (spoken(recording), recording.verdict) == (["one"], Verdict.FINISHED)
    assert recording.start.x == 300


def test_what_is_marked_instead_is_told(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, PROGRAM, two_programs("two"), "if False:\n    %sim_magic -R -b Simple_Shapes"]
    result = graded(tmp_path, runner, [*cells[:1], PROGRAM.replace("Loop", "Simple_Shapes"), *cells[2:]])
    assert spoken(result.trials[0].recording) == ["done"]
    assert any("that is run 1 of 3, the last that fits" in note for note in result.notes)
    never = graded(tmp_path, runner, [RESPONDER, two_programs("one"), cells[3]])
    assert "the run of cell 3 was never come to, so that of cell 2 is marked" in never.notes


def test_a_responder_that_comes_too_late_is_told_with_its_cell(tmp_path: Path, runner: TrialRunner) -> None:
    recording = recorded(tmp_path, runner, [PROGRAM, "x = 1", RESPONDER, "y = 2"])
    told = {(fault.message, fault.hint) for fault in recording.faults}
    assert told == {
        ("the responder is defined in cell 3, after the robot of cell 1 has run", "Move cell 3 above cell 1.")
    }
    assert "there is no responder" in recorded(tmp_path, runner, [PROGRAM, "x = 1"]).faults[0].message


def test_a_marked_cell_that_fails_is_told_with_its_line(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, two_programs("one"), "import math\nmath.sqrt(-1)\n%sim_magic -R"]
    result = graded(tmp_path, runner, cells, 'cell = "tag:this"', tags={3: ["this"]})
    (fault,) = result.trials[0].recording.faults
    assert (fault.message, fault.place) == ("ValueError: math domain error", "cell 3, line 2")
    assert fault.hint == "The robot program of cell 3 is marked, and was never run."
    assert (result.verdict, result.marks) == (Verdict.PROGRAM_ERROR, Decimal(0))


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ('"tag:mark me"', 'ada.ipynb: has no cell with the tag "mark me", expected'),
        ('"tag:plain"', 'ada.ipynb: cell 1 has the tag "plain" but runs no robot, expected'),
        ("3", "ada.ipynb: has 1 robot program, expected at least 3"),
    ],
)
def test_a_notebook_without_the_cell_asked_for_is_refused(tmp_path: Path, cell: str, words: str) -> None:
    asked = assignment(tmp_path, f"cell = {cell}")
    path = notebook(tmp_path / "ada.ipynb", [RESPONDER, PROGRAM], {1: ["plain"]})
    with pytest.raises(UsageError) as refused:
        read_submission(path, asked=asked.parts)
    assert words in str(refused.value)


@pytest.mark.parametrize("cell", ["0", "true", '"first"', '"tag:"', "1.5"])
def test_what_is_no_cell_is_refused(tmp_path: Path, cell: str) -> None:
    with pytest.raises(AssignmentProblems) as refused:
        assignment(tmp_path, f"cell = {cell}")
    assert "cell is no cell of a notebook, expected" in str(refused.value)


# Parts.


def test_a_given_program_meets_the_responder_that_the_notebook_ends_with(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, "def other(text):\n    return 'other'", two_programs("mine"), "roboSim.pyresponder = other"]
    given = {"given.py": 'import time\nprint("PY::hi")\ntime.sleep(1)\n'}
    result = graded(tmp_path, runner, cells, 'program = "given.py"', given=given)
    recording = result.trials[0].recording
    assert (answers(recording), recording.spoken) == (["other"], ())
    assert any("the assignment brings the robot program" in note for note in result.notes)


def test_a_notebook_without_a_robot_program_will_do_where_the_program_is_given(
    tmp_path: Path, runner: TrialRunner
) -> None:
    given = {"given.py": 'print("PY::hi")\nimport time\ntime.sleep(1)\n'}
    result = graded(tmp_path, runner, [RESPONDER], 'program = "given.py"', given=given)
    assert answers(result.trials[0].recording) == ["heard PY::hi"]
    with pytest.raises(UsageError, match="has no robot program, expected a cell"):
        graded(tmp_path, runner, [RESPONDER])


def test_only_the_program_is_taken_where_no_responder_is_asked_for(tmp_path: Path, runner: TrialRunner) -> None:
    cells = ["while True: pass", "%%sim_magic_preloaded -R\nsay('one')", "#\n%%sim_magic_preloaded\nsay('two')\n1/0"]
    result = graded(tmp_path, runner, cells, 'responder = "none"')
    recording = result.trials[0].recording
    assert spoken(recording) == ["two"]
    assert [(fault.verdict, fault.place) for fault in recording.faults] == [(Verdict.PROGRAM_ERROR, "cell 3, line 4")]
    assert "of ada.ipynb only the robot program in cell 3 is run" in result.notes


def test_files_beside_win_when_they_are_what_is_asked_for(tmp_path: Path) -> None:
    folder = tmp_path / "ada"
    folder.mkdir()
    notebook(folder / "notes.ipynb", [RESPONDER, PROGRAM])
    (folder / "robot.py").write_text("say('robot')")
    program_only = read_submission(folder, asked=Parts(responder="none"))
    assert (program_only.notebook, program_only.program is not None) == (None, True)
    both = read_submission(folder, asked=Parts())
    assert both.notebook is not None
    assert (both.program, both.files["robot.py"]) == (None, b"say('robot')")
    (folder / "responder.py").write_text(RESPONDER)
    assert read_submission(folder).notebook is None
    notebook(folder / "more.ipynb", [PROGRAM])
    (folder / "robot.py").unlink()
    (folder / "responder.py").unlink()
    with pytest.raises(UsageError, match=r"has 2 notebooks in it \(more.ipynb, notes.ipynb\), expected one"):
        read_submission(folder)


def test_what_the_database_keeps_is_the_same_submission(tmp_path: Path) -> None:
    path = notebook(tmp_path / "ada.ipynb", [RESPONDER, PROGRAM, "x = '\u2028 \ud800'"], {2: ["a", "b\nc"]})
    submission = read_submission(path)
    kept = unpack_submission(pack_submission(submission))
    assert kept == submission
    (tmp_path / "again.zip").write_bytes(pack_submission(submission))
    again = read_submission(tmp_path / "again.zip").notebook
    assert again is not None
    assert replace(submission, notebook=replace(again, name="ada.ipynb")).sha256 == submission.sha256
    changed = notebook(tmp_path / "ada.ipynb", [RESPONDER, PROGRAM + "#"], {2: ["a"]})
    assert read_submission(changed).sha256 != submission.sha256
    assert fit_parts(kept, Parts()).notebook == submission.notebook


# What cells do.


def test_data_of_a_run_is_there_for_later_cells(tmp_path: Path, runner: TrialRunner) -> None:
    log = (
        "%%sim_magic_preloaded -b Linear_grey -R\nfor i in range(3):\n"
        '    print("Light_left:", colorLeft.reflected_light_intensity, get_clock())\n    print("image_data both")\n'
        "    tank_drive.on_for_seconds(20, 20, 0.5)"
    )
    cells = [
        RESPONDER,
        log,
        "df = %sim_data\nlist(df.columns), len(df), df.value.is_monotonic_increasing",
        "roboSim.image_data().shape, len(roboSim.results_log)",
        "pair = %sim_image_pair\npair[0].size",
        "%sim_data --clear\nlen(roboSim.results_log)",
        "for place in (200, 400):\n    %sim_magic -R -x $place -y {place + 1}\nlen(roboSim.results_log)",
        PROGRAM,
    ]
    output = recorded(tmp_path, runner, cells).responder_output
    assert "(['time', 'variable', 'value'], 3, True)" in output
    assert "--- cell 4 ---\n((6, 3), 3)" in output
    assert "(14, 14)" in output
    assert "--- cell 6 ---\n0\n--- cell 7 ---\n6" in output


def test_a_responder_sees_what_the_robot_has_logged_so_far(tmp_path: Path, runner: TrialRunner) -> None:
    program = '%%sim_magic_preloaded\nimport time\nfor i in range(3):\n    print("Gyro: 1")\n    print("PY::n")\n'
    cells = ["def responder(text):\n    return str(len(roboSim.results_log))", program + "time.sleep(1)"]
    assert answers(recorded(tmp_path, runner, cells)) == ["1", "2", "3"]


@pytest.mark.parametrize(
    ("cells", "note"),
    [
        ([RESPONDER, PROGRAM, "x = 1"], "the robot program in cell 2 of {name} is marked"),
        (
            [RESPONDER, PROGRAM, "%sim_magic -R -x 200"],
            "the robot program in cell 2 of {name} is marked, as it is run again by cell 3",
        ),
    ],
)
def test_the_report_says_which_cell_is_marked(tmp_path: Path, runner: TrialRunner, cells: list[str], note: str) -> None:
    assert graded(tmp_path, runner, cells).notes[0] == note.format(name="ada.ipynb")


@pytest.mark.parametrize(
    ("cell", "note"),
    [
        ("!ls -l", "cell 2, line 1: !ls -l was refused: programs here may not start other programs"),
        ("x = 1\nfiles = !ls", "cell 2, line 2: !ls was refused"),
        ("%%bash\nls", "cell 2, line 1: %%bash was refused"),
        ("pip install torch", "cell 2, line 1: %pip was refused: packages cannot be installed here"),
        ("%pip install torch", "cell 2, line 1: %pip was refused"),
        ("%%nwdiag\na -> b;", "cell 2, line 1: %%nwdiag was skipped: only %%blockdiag and %%seqdiag are drawn here"),
        (
            "%%seqdiag\n# one\na -> -> b;",
            "cell 2, line 3: '->' stands here, expected the name of an actor; the diagram",
        ),
        ("%run other.py", "cell 2, line 1: FileNotFoundError: there is no file other.py beside the notebook"),
        ("%%nonsense\nhello", "cell 2, line 1: %%nonsense was skipped"),
        ("1 +", "cell 2, line 1: SyntaxError: invalid syntax; the other cells were run all the same"),
        ("\n\nopen('/etc/passwd')", "cell 2, line 3: programs here may only open files in their own folder"),
        ("raise SystemExit('no')", "cell 2, line 1: SystemExit: no"),
        ("%sim_magic -R", "cell 2, line 1: no robot program has been loaded; nothing was run"),
        ("%sim_magic --nope", "cell 2, line 1: there is no flag --nope"),
        ("%sim_magic_preloaded -R", "cell 2, line 1: %sim_magic_preloaded in a single line does nothing"),
        ("get_ipython().system('rm x')", "cell 2, line 1: !rm x was refused"),
    ],
)
def test_what_cannot_be_done_is_told_and_the_rest_goes_on(
    tmp_path: Path, runner: TrialRunner, cell: str, note: str
) -> None:
    result = graded(tmp_path, runner, [RESPONDER, cell, PROGRAM])
    assert any(each.startswith(note) for each in result.notes), result.notes
    assert result.verdict is Verdict.FINISHED
    assert answers(result.trials[0].recording) == ["heard PY::hello"]


@pytest.mark.parametrize(
    "cell",
    [
        "%load_ext nbev3devsim\n%matplotlib inline\nroboSim?",
        "import matplotlib.pyplot as plt\nfigure, axes = plt.subplots()\nplt.plot([1, 2]);\naxes.hist([1])",
        "from tqdm import trange\nassert sum(trange(4)) == 6\nfrom IPython.display import display, Image\ndisplay(1)",
        "import pandas as pd\npd.DataFrame({'a': [1, 2]}).plot(x='a')",
        "%%time\ntotal = sum(range(10))",
        "exit()",
        "text = '''\n%not a magic\n!nor this\n'''\nvalue = (7\n % 4)\nassert value == 3 and 'nor' in text",
        "%%capture\nprint('unseen')",
        "import time\nbegan = time.time()\ntime.sleep(3)\nassert time.time() - began == 3",
    ],
)
def test_what_only_shows_or_sets_up_is_let_through(tmp_path: Path, runner: TrialRunner, cell: str) -> None:
    result = graded(tmp_path, runner, [RESPONDER, cell, PROGRAM])
    assert [note for note in result.notes if note.startswith("cell")] == []
    assert "unseen" not in result.trials[0].recording.responder_output
    assert result.verdict is Verdict.FINISHED


def test_writefile_cat_and_values_at_the_end_of_a_cell(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [
        RESPONDER,
        "%%writefile notes.txt\none",
        "%%writefile -a notes.txt\ntwo",
        "%cat notes.txt",
        "3 * 7",
        PROGRAM,
    ]
    output = recorded(tmp_path, runner, cells).responder_output
    assert "Writing notes.txt" in output
    assert "--- cell 4 ---\none\ntwo\n" in output
    assert "--- cell 5 ---\n21" in output


# Faults and limits.


def test_a_responder_that_fails_is_told_by_cell_and_line_with_the_lines_around(
    tmp_path: Path, runner: TrialRunner
) -> None:
    cells = ["import re\n\ndef responder(text):\n    # a comment\n    return codemap[text]", "x = 1", PROGRAM]
    result = graded(tmp_path, runner, cells)
    (fault,) = result.trials[0].recording.faults
    assert (fault.message, fault.place) == ("NameError: name 'codemap' is not defined", "cell 1, line 5")
    submission = read_submission(tmp_path / "ada.ipynb")
    (group,) = fault_groups(result, submission)
    assert group.where == "Responder (ada.ipynb), cell 1, line 5"
    assert [line.text for line in group.excerpt if line.marked] == ["    return codemap[text]"]


def test_no_responder_is_a_fault_with_the_cell_that_may_be_why(tmp_path: Path, runner: TrialRunner) -> None:
    recording = recorded(tmp_path, runner, ["import torch\n" + RESPONDER, "%%sim_magic_preloaded\nsay('x')"])
    (fault,) = recording.faults
    assert fault.verdict is Verdict.RESPONDER_ERROR
    assert "there is no responder" in fault.message
    assert fault.hint.startswith("In cell 1, line 1: ModuleNotFoundError: No module named 'torch': numpy, pandas,")


@pytest.mark.parametrize(
    ("cell", "verdict", "words"),
    [
        ("n = 0\nwhile True:\n    n += 1", Verdict.CPU_LIMIT, "computed for more than 1 seconds"),
        ("b = bytearray(1 << 40)", None, "MemoryError"),
        ("while True:\n    print('flood' * 100)", Verdict.OUTPUT_LIMIT, "printed more than"),
        ("import os\nos._exit(0)", Verdict.RESPONDER_ERROR, "its process ended"),
    ],
)
def test_limits_stop_the_notebook_and_keep_what_was_marked_before(
    tmp_path: Path, runner: TrialRunner, cell: str, verdict: Verdict | None, words: str
) -> None:
    after = graded(tmp_path, runner, [RESPONDER, PROGRAM, cell])
    recording = after.trials[0].recording
    assert spoken(recording) == ["done"]
    if verdict is None:
        assert recording.faults == ()
        assert any("asked for more memory" in note for note in after.notes)
        return
    (fault,) = recording.faults
    assert (fault.verdict, fault.cell) == (verdict, 3)
    assert words in fault.message
    before = recorded(tmp_path, runner, [RESPONDER, cell, PROGRAM])
    assert (before.faults[0].cell, before.faults[0].who, len(before.ticks)) == (2, "program", 0)
    assert before.verdict is (Verdict.PROGRAM_ERROR if verdict is Verdict.RESPONDER_ERROR else verdict)


def test_the_same_notebook_gives_the_same_chain_whatever_ran_before(tmp_path: Path, runner: TrialRunner) -> None:
    drive = "import random\ntank_drive.on_for_seconds(30, 40, random.random())"
    noisy = f"%%sim_magic_preloaded -R -N 20 -M 20 -b Loop\n{drive}"
    cells = [
        "import random\ndef responder(text):\n    return f'{random.random()} {roboSim.robot_state.get(\"x\")}'",
        noisy,
        "for i in range(3):\n    %sim_magic -R -x {random.randint(100, 900)}",
        "import random\nprint([random.random() for i in range(3)])",
        PROGRAM,
    ]
    first = recorded(tmp_path, runner, cells)
    recorded(tmp_path, runner, [RESPONDER, PROGRAM])
    second = recorded(tmp_path, runner, cells)
    assert (first.sha256, first.responder_output) == (second.sha256, second.responder_output)
    assert answers(first) == answers(second)


def test_a_responder_may_call_magics_but_no_second_robot(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [
        "def responder(text):\n    %sim_magic -R\n    %cat log.txt\n    !ls\n    return 'ok'",
        "%%writefile log.txt\nhi",
    ]
    result = graded(tmp_path, runner, [*cells, PROGRAM])
    recording = result.trials[0].recording
    assert (answers(recording), recording.verdict) == (["ok"], Verdict.FINISHED)
    assert "cell 1, line 2: %sim_magic was skipped: the robot is still running" in result.notes
    assert recording.responder_output.endswith("hi\n")


def test_the_program_whose_text_is_marked_is_the_one_that_is_run(tmp_path: Path, runner: TrialRunner) -> None:
    """A notebook changes what its own magics hand over."""
    swap = (
        "shell = type(get_ipython())\nreal = shell.run_cell_magic\n"
        "shell.run_cell_magic = lambda self, name, line, cell: real(self, name, line, 'tank_drive.on(50, 50)')"
    )
    cells = [swap, "%%sim_magic_preloaded -R\nprint('as it stands')", RESPONDER]
    rule = '[[criterion]]\ntitle = "T"\nmarks = 1\ncheck = "source"\navoids = ["on()"]\n'
    assignment(tmp_path)
    (tmp_path / "assignment.toml").write_text((tmp_path / "assignment.toml").read_text() + rule)
    result = grade(read_submission(notebook(tmp_path / "a.ipynb", cells)), read_assignment(tmp_path), runner=runner)
    assert [line.text for line in result.trials[0].recording.printed] == ["as it stands"]


def test_forged_frames_end_the_notebook(tmp_path: Path, runner: TrialRunner) -> None:
    forged = 'import os\nos.write(3, b\'{"n":2,"do":"executed","missing":null}\\n\')'
    (fault,) = recorded(tmp_path, runner, [RESPONDER, forged, PROGRAM]).faults
    assert (fault.verdict, fault.cell) == (Verdict.SANDBOX_VIOLATION, 2)


@pytest.mark.long
def test_runs_that_are_not_marked_have_an_end(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, two_programs("x"), "for i in range(400):\n    %sim_magic -R", PROGRAM]
    result = graded(tmp_path, runner, cells)
    assert any("a notebook may start it 300 times" in note for note in result.notes)
    assert spoken(result.trials[0].recording) == ["done"]


# A notebook's life.


def test_what_was_not_run_after_a_cut_is_listed(tmp_path: Path, runner: TrialRunner) -> None:
    result = graded(tmp_path, runner, [RESPONDER, "while True:\n    pass", PROGRAM, "print('never')"])
    assert "cells 3 to 4 were not run: the notebook was stopped in cell 2" in result.notes
    assert "never" not in result.trials[0].recording.responder_output


def test_a_marked_program_may_stand_below_wrappers(tmp_path: Path, runner: TrialRunner) -> None:
    recording = recorded(tmp_path, runner, [RESPONDER, "%%capture\n%%time\n" + PROGRAM + "print(1 / 0)"])
    assert spoken(recording) == ["done"]
    assert [fault.place for fault in recording.faults] == ["cell 2, line 8"]


def test_a_robot_can_be_looked_at_before_it_runs(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [
        RESPONDER,
        "robot = %sim_robot_state\nprint('fresh', robot.state['x'], robot.state['left_light'])",
        "%sim_magic -b Loop -x 700 -y 800 -a 0",
        "robot = %sim_robot_state\nprint('placed', robot.state['x'], robot.state['sensor2dataArray'].count(','))",
        PROGRAM,
    ]
    output = recorded(tmp_path, runner, cells).responder_output
    assert "fresh 200 255" in output
    assert "placed 700 1599" in output


def test_no_path_of_the_machine_is_told(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [
        RESPONDER,
        "import os\nprint('here', os.getcwd())",
        "from numpy import no_such_name",
        "import warnings\nwarnings.warn('careful')",
        "import numpy\nnumpy",
        "open(os.path.join(os.getcwd(), 'missing.txt'))",
        PROGRAM,
    ]
    result = graded(tmp_path, runner, cells)
    told = "\n".join([*result.notes, result.trials[0].recording.responder_output])
    assert "cannot import name 'no_such_name' from 'numpy' (numpy/__init__.py)" in told
    assert "No such file or directory: 'missing.txt'" in told
    assert "here ." in told
    assert str(Path(sys.prefix)) not in told
    assert "/tmp/" not in told
    assert "/lib/python" not in told
