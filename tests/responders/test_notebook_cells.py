"""Features of notebook cells: data between runs, magics, files, errors with their lines, limits and endings."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from graded_notebooks import PROGRAM, RESPONDER, answers, assignment, graded, recorded, spoken, two_programs
from notebook_builder import notebook
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.faults import group_faults
from sim.recording import Verdict
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission


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


def test_a_module_that_a_cell_imports_may_display(tmp_path: Path, runner: TrialRunner) -> None:
    module = "%%writefile shown.py\ndef show(value):\n    display(value)\n    return get_ipython() is not None"
    output = recorded(tmp_path, runner, [module, "import shown\nshown.show(7)", RESPONDER, PROGRAM]).responder_output
    assert "--- cell 2 ---\n7\nTrue" in output


@pytest.mark.parametrize(
    ("cells", "note"),
    [
        ([RESPONDER, PROGRAM, "x = 1"], "the robot program in cell 2 of {name} is marked"),
        (
            [RESPONDER, PROGRAM, "%sim_magic -R -x 200"],
            "the robot program in cell 2 of {name} is marked, because it is run again by cell 3",
        ),
    ],
)
def test_the_report_says_which_cell_is_marked(tmp_path: Path, runner: TrialRunner, cells: list[str], note: str) -> None:
    assert graded(tmp_path, runner, cells).notes[0] == note.format(name="ada.ipynb")


@pytest.mark.long
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
        (
            "%%seqdiagram\n{ a -> b; }",
            "cell 2, line 1: %%seqdiagram was skipped: it is not known here; did you mean %%seqdiag?",
        ),
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
        "%load_ext robomark_notebook\n%robomark check stop-at-line",
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
    (group,) = group_faults(result, submission)
    assert group.where == "Responder (ada.ipynb), cell 1, line 5"
    assert [line.text for line in group.excerpt if line.marked] == ["    return codemap[text]"]


def test_no_responder_is_a_fault_with_the_cell_that_may_be_why(tmp_path: Path, runner: TrialRunner) -> None:
    recording = recorded(tmp_path, runner, ["import torch\n" + RESPONDER, "%%sim_magic_preloaded\nsay('x')"])
    (fault,) = recording.faults
    assert fault.verdict is Verdict.RESPONDER_ERROR
    assert "there is no responder" in fault.message
    assert fault.hint.startswith("In cell 1, line 1: ModuleNotFoundError: No module named 'torch': numpy, pandas,")


@pytest.mark.long
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
    """A notebook changes the program that its own magics pass on."""
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


# The lifetime of a notebook.


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
    output = "\n".join([*result.notes, result.trials[0].recording.responder_output])
    assert "cannot import name 'no_such_name' from 'numpy' (numpy/__init__.py)" in output
    assert "No such file or directory: 'missing.txt'" in output
    assert "here ." in output
    assert str(Path(sys.prefix)) not in output
    assert "/tmp/" not in output
    assert "/lib/python" not in output
