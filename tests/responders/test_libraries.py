"""Libraries, dates and warnings in student code: the same in robot programs, responders and notebooks."""

from __future__ import annotations

from pathlib import Path

import pytest

from notebook_builder import notebook
from running import run_program
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording, Verdict
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission

DATES = """
import copy, datetime, pickle
from datetime import date, datetime as moment
class Mine(moment):
    pass
now = moment.now()
checks = {
    "one type": datetime.datetime is moment and type(now) is moment and type(date.today()) is date,
    "derived": type(Mine(2020, 1, 2)) is Mine and type(Mine.now()) is Mine and type(Mine.today()) is Mine,
    "tested": isinstance(now, date) and not isinstance(now, Mine) and issubclass(Mine, moment),
    "pickled": type(pickle.loads(pickle.dumps(now))) is moment and pickle.loads(pickle.dumps(moment)) is moment,
    "copied": copy.deepcopy(now) == now and copy.copy(moment) is moment,
    "read": type(moment.fromisoformat("2020-01-02")) is moment and type(now.replace(year=2021)) is moment,
    "simulated": {now, moment.today(), moment.utcnow()} == {moment(2020, 1, 1)} and date.today() == date(2020, 1, 1),
    "zones": moment.now(datetime.timezone.utc).tzinfo is datetime.timezone.utc,
}
print([name for name, holds in checks.items() if not holds])
"""
LIBRARIES = """
import numpy, pandas
from PIL import Image
from sklearn.neighbors import KNeighborsClassifier
near = KNeighborsClassifier(1).fit(numpy.eye(2), ["a", "b"])
print(near.predict([[1, 0]])[0], pandas.Timestamp.now().year, Image.new("L", (2, 3)).size, numpy.random.rand())
"""
WARNS = """
import warnings
import numpy
numpy.array([1.0]) / 0
warnings.warn("careful")
print("done")
"""


def of_program(runner: TrialRunner, text: str) -> list[str]:
    return [line.text for line in run_program(runner, text).printed]


def of_responder(runner: TrialRunner, text: str) -> list[str]:
    recording = run_program(runner, "pass", responder=text + "\ndef responder(text):\n    return text\n")
    return recording.responder_output.split("\n")


def of_notebook(folder: Path, runner: TrialRunner, text: str) -> Recording:
    cells = [text, "def responder(text):\n    return text", "%%sim_magic_preloaded\npass"]
    assignment = find_assignment("echo-responder")
    return (
        grade(
            read_submission(notebook(folder / "ada.ipynb", cells), required_parts=assignment.parts),
            assignment,
            runner=runner,
        )
        .trials[0]
        .recording
    )


def test_dates_are_of_one_type(tmp_path: Path, runner: TrialRunner) -> None:
    assert of_program(runner, DATES) == ["[]"]
    assert of_responder(runner, DATES) == ["[]"]
    assert "\n[]" in of_notebook(tmp_path, runner, DATES).responder_output


@pytest.mark.long
def test_libraries_work_in_a_robot_program_as_in_a_responder(runner: TrialRunner) -> None:
    (output,) = of_program(runner, LIBRARIES)
    assert output.startswith("a 2020 (2, 3) 0.")
    assert of_program(runner, LIBRARIES) == [output]
    (other,) = of_responder(runner, LIBRARIES)
    assert other.startswith("a 2020 (2, 3) 0.")


@pytest.mark.parametrize("module", ["matplotlib.pyplot", "torch"])
def test_what_is_not_there_is_told_with_what_is(runner: TrialRunner, module: str) -> None:
    recording = run_program(runner, f"import {module}")
    (fault,) = recording.faults
    top = module.partition(".")[0]
    assert (fault.verdict, fault.line) == (Verdict.PROGRAM_ERROR, 1)
    assert fault.message.startswith(f"ModuleNotFoundError: No module named '{top}': numpy, pandas, scikit-learn")


def test_no_warning_is_a_text_of_the_students(tmp_path: Path, runner: TrialRunner) -> None:
    recording = run_program(runner, WARNS, responder=WARNS + "\ndef responder(text):\n    return text\n")
    assert [line.text for line in recording.printed] == ["done"]
    assert recording.responder_output == "done"
    assert recording.notes == tuple(
        f"line {line} of the {who}: {warning}"
        for who in ("program", "responder")
        for line, warning in (
            (4, "RuntimeWarning: divide by zero encountered in divide"),
            (5, "UserWarning: careful"),
        )
    )
    notes = of_notebook(tmp_path, runner, WARNS)
    assert "careful" not in notes.responder_output
    assert "cell 1, line 5: UserWarning: careful" in notes.notes
