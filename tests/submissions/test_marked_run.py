"""The marked run of a notebook: the last one that fits the assignment, or the selected one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from notebook_builder import notebook
from sim.errors import UsageError
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.marked_run import RunChoice, choose_run
from submissions.part_fitting import fit_parts
from submissions.stored_submission import pack_submission, unpack_submission
from submissions.submission import Submission

ANSWER = "def responder(text):\n    return text"
SHAPES = '%%sim_magic_preloaded -b Simple_Shapes -x 520 -R\nimport time\nprint("IMG_DATA")\ntime.sleep(1)'
LOOP = SHAPES.replace("Simple_Shapes", "Loop")
DRIVES = "%%sim_magic_preloaded -R\ntank_drive.on_for_seconds(30, 30, 1)"
SENSOR = "%%sim_magic_preloaded\nprint(colorLeft.color)"
BROKEN = "%%sim_magic_preloaded\nprint(colorLeft.color"


def submitted(folder: Path, cells: Sequence[str], run: str | None = None) -> Submission:
    path = notebook(folder / "ada.ipynb", cells, {2: ["final"]})
    return replace(read_submission(path), run=run)


def chosen(submission: Submission, responder: str = "student", cell: str = "last") -> RunChoice:
    graded_assignment = find_assignment("shape-recognition")
    assignment = replace(graded_assignment, parts=replace(graded_assignment.parts, responder=responder, cell=cell))
    assert submission.notebook is not None
    return choose_run(submission.notebook, assignment, submission.run)


@pytest.mark.parametrize(
    ("cells", "responder", "cell"),
    [
        ([ANSWER, SHAPES, SHAPES], "student", 3),
        ([ANSWER, SHAPES, LOOP], "student", 2),
        ([ANSWER, SHAPES, SENSOR], "student", 2),
        ([ANSWER, SHAPES, DRIVES], "student", 2),
        ([ANSWER, SHAPES, DRIVES], "none", 3),
        ([ANSWER, DRIVES, SENSOR], "none", 2),
        ([ANSWER, DRIVES, BROKEN], "none", 3),
        # A floor stays until another one is selected, also by a line that starts no run.
        ([ANSWER, SHAPES, "%sim_magic -b Loop", "%sim_magic -R"], "student", 2),
        ([ANSWER, LOOP, "%sim_magic -b Simple_Shapes -R"], "student", 3),
        # Values known only after execution do not count against a run.
        ([ANSWER, SHAPES, "%sim_magic -R -b $floor"], "student", 3),
        # If none fits, the run with the fewest differences.
        ([ANSWER, LOOP, SENSOR.replace("preloaded", "preloaded -b Loop")], "student", 2),
        ([ANSWER, SENSOR], "student", 2),
    ],
)
def test_the_last_run_that_fits_is_marked(tmp_path: Path, cells: Sequence[str], responder: str, cell: int) -> None:
    assert chosen(submitted(tmp_path, cells), responder).site.cell == cell


def test_the_choice_is_told_with_the_others(tmp_path: Path) -> None:
    choice = chosen(submitted(tmp_path, [ANSWER, SHAPES, LOOP, SENSOR]))
    assert choice.notes == (
        "that is run 1 of 3, the last that fits; the others are run 2 (cell 3: its floor is Loop), "
        "run 3 (cell 4: its floor is Loop)",
        "another run is marked with --run NUMBER, or with run = NUMBER in submission.toml",
    )
    assert [site.cell for site in choice.others] == [3, 4]
    assert chosen(submitted(tmp_path, [ANSWER, SHAPES])).notes == ()
    misfit = chosen(submitted(tmp_path, [ANSWER, LOOP, LOOP]))
    assert misfit.notes[0].startswith("that is run 2 of 2, which fits best, though its floor is Loop; the others are")


@pytest.mark.parametrize(("run", "cell"), [("1", 2), ("2", 3), ("final", 2), ("tag:final", 2)])
def test_another_run_is_marked_where_it_is_asked_for(tmp_path: Path, run: str, cell: int) -> None:
    submission = submitted(tmp_path, [ANSWER, LOOP, SHAPES], run)
    choice = chosen(submission)
    assert (choice.site.cell, choice.others) == (cell, ())
    assert f"as run = {run} asks" in choice.notes[0]
    assert unpack_submission(pack_submission(submission)) == submission
    assert submission.sha256 != replace(submission, run=None).sha256


def test_what_the_assignment_names_wins(tmp_path: Path) -> None:
    choice = chosen(submitted(tmp_path, [ANSWER, LOOP, SHAPES], "2"), cell="tag:final")
    assert (choice.site.cell, choice.only) == (2, True)
    assert choice.notes == ("run = 2 is not used: the assignment says which run is marked",)


@pytest.mark.parametrize("run", ["0", "3", "nobody", "9" * 5000])
def test_a_run_that_is_not_there_is_refused(tmp_path: Path, run: str) -> None:
    assignment = find_assignment("shape-recognition").parts
    with pytest.raises(UsageError, match=r"ada\.ipynb: has no (run|cell)") as caught:
        fit_parts(submitted(tmp_path, [ANSWER, LOOP, SHAPES], run), assignment)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(("toml", "run"), [("run = 2", "2"), ('run = "final"', "final"), ("", None)])
def test_a_submission_says_which_run(tmp_path: Path, toml: str, run: str | None) -> None:
    folder = tmp_path / "ada"
    folder.mkdir()
    notebook(folder / "ada.ipynb", [ANSWER, LOOP, SHAPES], {2: ["final"]})
    (folder / "submission.toml").write_text(toml)
    assert read_submission(folder).run == run
    (folder / "submission.toml").write_text("run = true")
    with pytest.raises(UsageError, match=r"run in submission\.toml is not a text"):
        read_submission(folder)
