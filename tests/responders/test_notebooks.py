"""Notebooks as submissions: executed from top to bottom, with one run marked, and all other runs noted."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from command import robomark
from graded_notebooks import PROGRAM, RESPONDER, answers, assignment, graded, recorded, spoken, two_programs
from models import load_weights
from notebook_builder import MESSAGING, MESSAGING_SCRIPT, notebook
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from sim.recording import Verdict
from submissions.assignment.definition import Parts
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.part_fitting import fit_parts
from submissions.stored_submission import pack_submission, unpack_submission


@pytest.fixture(params=["ipynb", "py"])
def messaging(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return the course's notebook with its network, as .ipynb and as nbconvert's .py."""
    folder = tmp_path / "ada"
    folder.mkdir()
    shutil.copy(MESSAGING if request.param == "ipynb" else MESSAGING_SCRIPT, folder / f"messaging.{request.param}")
    (folder / "mlp_shapes_14x14.joblib").write_bytes(load_weights("shapes"))
    return folder


@pytest.mark.long
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
    tested_assignment = find_assignment(name)
    without_noise = tuple(each for each in tested_assignment.scenarios if not any(each.light_noise))
    graded_assignment = replace(
        tested_assignment, parts=replace(tested_assignment.parts, cell=cell), scenarios=without_noise
    )
    result = grade(read_submission(messaging, required_parts=graded_assignment.parts), graded_assignment, runner=runner)
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


@pytest.mark.long
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
    # Flags of the command line apply to the last run.
    assert done.stdout.count("(says) Is that a left facing triangle") == 1
    images = [tmp_path / "p.png", *(tmp_path / "d" / f"cell-{number}.png" for number in (2, 7, 15, 27))]
    assert all(image.read_bytes().startswith(b"\x89PNG") for image in images)
    assert len(list((tmp_path / "d").iterdir())) == 4


def run_in(folder: Path, *arguments: str) -> str:
    command = [sys.executable, "-P", "-c", "from service.cli import main; main()", "run", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_run_prints_what_cells_print_around_the_robots_that_they_start(tmp_path: Path) -> None:
    robot = "%%sim_magic_preloaded -R\nsay('{}')"
    cells = [
        "print('before')",
        robot.format("first run"),
        "print('between')",
        robot.format("second run"),
        "print('after')",
    ]
    notebook(tmp_path / "a.ipynb", cells)
    output = run_in(tmp_path, "a.ipynb")
    words = ["before", "started by cell 2", "first run", "between", "started by cell 4", "second run", "after"]
    places = [output.index(word) for word in words]
    assert places == sorted(places)


@pytest.mark.long
@pytest.mark.parametrize(
    ("tick", "end"), [("thirtieth", "1.11 s  end"), pytest.param("browser", "1.10 s  end", marks=pytest.mark.long)]
)
def test_run_has_ticks_of_both_lengths(tmp_path: Path, tick: str, end: str) -> None:
    (tmp_path / "robot.py").write_text("tank_drive.on_for_seconds(30, 30, 1)\nprint(get_clock())\n")
    assert end in run_in(tmp_path, "robot.py", "--tick", tick)


def test_a_robot_program_draws_no_diagrams(tmp_path: Path) -> None:
    (tmp_path / "robot.py").write_text("say('hello')")
    done = robomark("run", tmp_path / "robot.py", "--diagrams", tmp_path / "d")
    assert done.returncode == 2
    assert "robot.py is not a notebook and has no diagrams; omit --diagrams" in done.stderr


# Selection of the marked run.


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
    assert "the run of cell 3 never started, so the run of cell 2 is marked" in never.notes


def test_a_responder_that_comes_too_late_is_told_with_its_cell(tmp_path: Path, runner: TrialRunner) -> None:
    recording = recorded(tmp_path, runner, [PROGRAM, "x = 1", RESPONDER, "y = 2"])
    messages = {(fault.message, fault.hint) for fault in recording.faults}
    assert messages == {
        ("the responder is defined in cell 3, after the robot of cell 1 has run", "Move cell 3 above cell 1.")
    }
    assert "there is no responder" in recorded(tmp_path, runner, [PROGRAM, "x = 1"]).faults[0].message


def test_a_marked_cell_that_fails_is_told_with_its_line(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, two_programs("one"), "import math\nmath.sqrt(-1)\n%sim_magic -R"]
    result = graded(tmp_path, runner, cells, 'cell = "tag:this"', tags={3: ["this"]})
    (fault,) = result.trials[0].recording.faults
    assert (fault.message, fault.place) == ("ValueError: math domain error", "cell 3, line 2")
    assert fault.hint == "The robot program of cell 3 is marked, but it never ran."
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
    graded_assignment = assignment(tmp_path, f"cell = {cell}")
    path = notebook(tmp_path / "ada.ipynb", [RESPONDER, PROGRAM], {1: ["plain"]})
    with pytest.raises(UsageError) as refused:
        read_submission(path, required_parts=graded_assignment.parts)
    assert words in str(refused.value)


@pytest.mark.parametrize("cell", ["0", "true", '"first"', '"tag:"', "1.5"])
def test_what_is_no_cell_is_refused(tmp_path: Path, cell: str) -> None:
    with pytest.raises(AssignmentProblems) as refused:
        assignment(tmp_path, f"cell = {cell}")
    assert "cell is not a notebook cell, expected" in str(refused.value)


# Parts.


@pytest.mark.parametrize(
    ("cell", "verdict"), [("roboSim.look()\n" * 3, Verdict.FINISHED), ("while True: roboSim.look()", Verdict.CPU_LIMIT)]
)
def test_the_workers_own_time_for_requests_is_charged(
    cell: str, verdict: Verdict, tmp_path: Path, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A request costs the notebook's process almost nothing and the worker a new floor or camera image."""
    seconds = iter(range(0, 10**6, 2))
    monkeypatch.setattr(time, "thread_time", lambda: float(next(seconds)))
    look = f"from nbev3devsim.load_nbev3devwidget import roboSim\n{cell}"
    recording = recorded(tmp_path, runner, [look, RESPONDER, PROGRAM])
    assert recording.verdict is verdict
    if verdict is Verdict.CPU_LIMIT:
        assert "all trials together computed for longer" in recording.faults[0].message


def test_a_given_program_meets_the_responder_that_the_notebook_ends_with(tmp_path: Path, runner: TrialRunner) -> None:
    cells = [RESPONDER, "def other(text):\n    return 'other'", two_programs("mine"), "roboSim.pyresponder = other"]
    given = {"given.py": 'import time\nprint("PY::hi")\ntime.sleep(1)\n'}
    result = graded(tmp_path, runner, cells, 'program = "given.py"', given=given)
    recording = result.trials[0].recording
    assert (answers(recording), recording.spoken) == (["other"], ())
    assert any("the assignment provides the robot program" in note for note in result.notes)


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
    program_only = read_submission(folder, required_parts=Parts(responder="none"))
    assert (program_only.notebook, program_only.program is not None) == (None, True)
    both = read_submission(folder, required_parts=Parts())
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


# Features of cells.
