"""Notebooks of a few cells, graded at once, and the recording of their marked run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from notebook_builder import notebook
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission

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
    graded_assignment = assignment(folder, parts, given)
    submission = read_submission(notebook(folder / "ada.ipynb", cells, tags), required_parts=graded_assignment.parts)
    return grade(submission, graded_assignment, runner=runner)


def recorded(folder: Path, runner: TrialRunner, cells: Sequence[str], parts: str = "") -> Recording:
    return graded(folder, runner, cells, parts).trials[0].recording


def spoken(recording: Recording) -> list[str]:
    return [line.text for line in recording.spoken]


def answers(recording: Recording) -> list[str]:
    return [message.text for message in recording.messages if message.sender == "responder"]


def two_programs(which: str) -> str:
    return f'%%sim_magic_preloaded -R\nsay("{which}")'
