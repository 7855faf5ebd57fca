"""``robomark assignments``: creation, its check, and the students' copy."""

from __future__ import annotations

import zipfile
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from command import robomark
from service.grading import example_check
from service.grading.example_check import ComparedMeasure, check_examples
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.errors import AssignmentError, UsageError
from submissions.assignment.assignment_overview import read_overview
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import ExpectedResult, OriginalMeasure, add_expected, read_example, read_expected
from submissions.assignment.export import create_assignment, export_all, export_for_students
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.assignment.problems import AssignmentProblems
from submissions.assignment.reader import find_assignment, read_assignment
from submissions.submission import Submission


def test_a_new_assignment_is_in_order_and_its_reference_gets_full_marks(tmp_path: Path, runner: TrialRunner) -> None:
    create_assignment(tmp_path / "my-task")
    checked = check_examples(str(tmp_path / "my-task"), runner=runner)
    assert checked.assignment.id == "my-task"
    assert [(example.name, example.problems) for example in checked.examples] == [
        ("reference", ()),
        ("stops-short", ()),
    ]
    assert checked.examples[0].marks == checked.assignment.max_marks


def test_a_new_assignment_like_another_marks_like_it(tmp_path: Path, runner: TrialRunner) -> None:
    create_assignment(tmp_path / "my-echo", "echo-responder")
    mine, theirs = read_assignment(tmp_path / "my-echo"), find_assignment("echo-responder")
    assert (mine.id, mine.criteria) == ("my-echo", theirs.criteria)
    assert check_examples(str(tmp_path / "my-echo"), runner=runner).problems == ()


@pytest.fixture(scope="module")
def known_grades() -> dict[str, Grade]:
    return {}


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ('[reference]\nmarks = "5"\n', "reference: got 6.00 marks, expected 5; nothing was lost"),
        ('[reference]\nmarks = "6"\nloses = ["says"]\n', "reference: lost marks in nothing, expected says"),
        ('[reference]\nmarks = "6"\nverdict = "time_limit"\n', "reference: ended as finished, expected time_limit"),
        ('[reference]\nmarks = "6"\nfeedback = ["Bravo"]\n', 'reference: did not get the feedback "Bravo", but'),
        ('[reference]\nmarks = "6"\n[other]\nmarks = "1"\n', "other: is expected, but is not an example"),
        (
            '[reference]\nmarks = "6"\n[stops-short]\nmarks = "3"\nloses = ["stop"]\n',
            'stops-short: expected.toml says it loses "stop", expected the id of a criterion: finishes, says, stops',
        ),
        ("", "stops-short: has no table in expected.toml (check --write-expected writes its results)"),
        (
            '[reference]\nmarks = "6"\nearns = { stops = "2", stop = "3" }\n',
            'reference: expected.toml says it earns "stop", expected the id of a criterion: finishes, says, stops',
        ),
        ('[reference]\nmarks = "6"\nearns = { stops = "2" }\n', "reference: got 3.00 marks for stops, expected 2"),
        (
            '[reference]\nmarks = "6"\n[[original]]\nmeasure = "height"\nvalue = 3\n',
            "reference: measured no height, expected about 3",
        ),
    ],
)
def test_what_is_not_as_expected_is_said(
    change: str,
    problem: str,
    tmp_path: Path,
    runner: TrialRunner,
    known_grades: dict[str, Grade],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The examples are graded once: only the expectations differ."""

    def grade_once(submission: Submission, assignment: Assignment, **options: Any) -> Grade:
        if submission.student not in known_grades:
            known_grades[submission.student] = grade(submission, assignment, **options)
        return known_grades[submission.student]

    monkeypatch.setattr(example_check, "grade", grade_once)
    create_assignment(tmp_path / "task")
    (tmp_path / "task" / "expected.toml").write_text(change)
    assert any(each.startswith(problem) for each in check_examples(str(tmp_path / "task"), runner=runner).problems)


def test_an_example_like_another_has_its_files_but_for_those_of_its_own(tmp_path: Path) -> None:
    create_assignment(tmp_path / "task", "echo-responder")
    (tmp_path / "task" / "expected.toml").write_text('[flawed]\nmarks = "1"\nlike = "reference"\n')
    own = tmp_path / "task" / "examples" / "flawed"
    (own / "robot.py").write_text("pass\n")
    (own / "responder.py").unlink()
    reference, flawed = (read_example(str(tmp_path / "task"), name) for name in ("reference", "flawed"))
    assert (flawed.student, flawed.responder) == ("flawed", reference.responder)
    assert flawed.program is not None
    assert flawed.program.text == "pass\n"


@pytest.mark.parametrize("text", ["[reference", '[a]\nmark = "6"\n', '[a]\nmarks = "many"\n', '[a]\nlike="../a"\n'])
def test_expectations_that_cannot_be_read_are_refused(text: str, tmp_path: Path) -> None:
    create_assignment(tmp_path / "task")
    (tmp_path / "task" / "expected.toml").write_text(text)
    with pytest.raises(AssignmentError, match=r"^task/expected\.toml:[12]: "):
        read_expected(str(tmp_path / "task"))


def test_all_mistakes_in_expectations_are_named_with_their_lines(tmp_path: Path) -> None:
    create_assignment(tmp_path / "task")
    (tmp_path / "task" / "expected.toml").write_text(
        '[reference]\nmark = "6"\n[other]\nmarks = "many"\nverdict = "fine"\n[[original]]\nmeasure = "a"\nvalue = "x"\n'
    )
    with pytest.raises(AssignmentProblems) as refused:
        read_expected(str(tmp_path / "task"))
    begins = ["1: marks is missing", '2: "mark" is not a key', "4: marks is ", "5: verdict is ", "8: value is "]
    assert len(refused.value.problems) == len(begins)
    for problem, begin in zip(refused.value.problems, begins, strict=True):
        assert problem.startswith(f"task/expected.toml:{begin}")


def test_the_check_of_a_reference_that_fails_says_with_what(tmp_path: Path, runner: TrialRunner) -> None:
    create_assignment(tmp_path / "task")
    (tmp_path / "task" / "examples" / "reference" / "robot.py").write_text("tank_drvie.off()\n")
    problems = check_examples(str(tmp_path / "task"), runner=runner).problems
    assert any("NameError: name 'tank_drvie' is not defined (line 1)" in problem for problem in problems)


@pytest.mark.long
def test_an_assignment_whose_own_check_fails_on_an_example_is_not_in_order(tmp_path: Path, runner: TrialRunner) -> None:
    """Even if this costs no marks."""
    create_assignment(tmp_path / "task")
    file = tmp_path / "task" / "assignment.toml"
    own = '\n[[criterion]]\nid = "own"\ntitle = "O"\nmarks = 0\ncheck = "python"\nfile = "check.py"\n'
    file.write_text(file.read_text() + own)
    (tmp_path / "task" / "check.py").write_text("def check(trial): return trial['printed'][99] == 'done'\n")
    problems = check_examples(str(tmp_path / "task"), runner=runner).problems
    expected_problem = (
        "own could not be judged: The assignment's own check fails: check.py: IndexError: list index out of range"
    )
    assert [problem.partition(" (")[0] for problem in problems] == [
        f"reference: {expected_problem}",
        f"stops-short: {expected_problem}",
    ]
    failed = robomark("assignments", "check", str(tmp_path / "task"))
    assert failed.returncode == 2
    assert "own could not be judged" in failed.stdout + failed.stderr


def test_ids_are_listed_whole_on_a_narrow_screen(tmp_path: Path) -> None:
    listed = robomark("assignments", "list").stdout
    assert all(name in listed for name in list_catalogue_ids())


@pytest.mark.parametrize(
    ("value", "agrees"), [(100.0, True), (101.0, True), (99.0, True), (101.1, False), (None, False)]
)
def test_a_figure_agrees_within_a_hundredth(value: float | None, agrees: bool) -> None:
    assert ComparedMeasure(OriginalMeasure(measure="side", value=100), value).is_close == agrees


def test_examples_and_starter_do_not_change_the_version(tmp_path: Path) -> None:
    create_assignment(tmp_path / "task")
    version = read_assignment(tmp_path / "task").version
    (tmp_path / "task" / "starter" / "robot.py").write_text("pass\n")
    (tmp_path / "task" / "expected.toml").write_text("")
    assert read_assignment(tmp_path / "task").version == version


def test_students_get_the_task_the_starter_and_the_given_files_and_nothing_that_is_hidden(tmp_path: Path) -> None:
    create_assignment(tmp_path / "task", "shape-recognition")
    path = tmp_path / "task" / "assignment.toml"
    path.write_text(
        path.read_text().replace('id = "shape-in-noise"\n', 'id = "shape-in-noise"\nvisibility = "hidden"\n')
    )
    export_for_students(str(tmp_path / "task"), tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip") as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    assert files.keys() == {"README.md", "robot.py", "responder.py", "mlp_shapes_14x14.joblib"}
    task = files["README.md"].decode()
    assert "| 6 | Names the right shape |" in task
    assert "with noise |" not in task
    assert "Marks for hidden criteria: 2" in task


def test_an_exported_assignment_is_the_same_assignment(tmp_path: Path) -> None:
    export_all("json-queue", tmp_path / "copy")
    assert read_assignment(tmp_path / "copy").version == find_assignment("json-queue").version
    assert (tmp_path / "copy" / "examples" / "reference" / "robot.py").is_file()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "task").mkdir()
    with pytest.raises(UsageError, match="exists already, expected a new folder"):
        create_assignment(tmp_path / "task")
    with pytest.raises(UsageError, match="cannot be the id of an assignment"):
        create_assignment(tmp_path / "My Task")


def test_check_says_what_is_wrong_and_ends_with_two(tmp_path: Path) -> None:
    create_assignment(tmp_path / "task")
    (tmp_path / "task" / "examples" / "reference" / "robot.py").write_text("say('red')\n")
    ended = robomark("assignments", "check", tmp_path / "task")
    assert ended.returncode == 2
    assert "task: reference: got 3.00 marks, expected 6; stops: 0 of 2 trials went as expected." in ended.stderr
    assert robomark("assignments", "check").returncode == 2


def test_answers_that_most_poses_share_are_warned_of() -> None:
    ended = robomark("assignments", "check", "black-or-grey")
    assert ended.returncode == 0, ended.stderr
    assert 'black-or-grey: criterion "says": one entry of expected fits 3 of the 5 poses' in ended.stderr


@pytest.mark.long
def test_what_new_examples_got_is_noted_and_nothing_that_stands_there_is_changed(tmp_path: Path) -> None:
    create_assignment(tmp_path / "task")
    file, old = tmp_path / "task" / "expected.toml", '# By hand.\n[stops-short]\nmarks = "3"\n'
    file.write_text(old)
    (tmp_path / "task" / "examples" / "says, nothing").mkdir()
    (tmp_path / "task" / "examples" / "says, nothing" / "robot.py").write_text("tank_drive.off()\n")
    noted = robomark("assignments", "check", tmp_path / "task", "--write-expected")
    assert noted.returncode == 0, noted.stderr
    assert "results of reference, says, nothing written; check that they are the expected ones" in noted.stdout
    assert file.read_text().startswith(old)
    tables = read_expected(str(tmp_path / "task")).examples
    assert tables["reference"].marks == 6
    assert tables["says, nothing"].marks == sum(tables["says, nothing"].earns.values()) + 1
    again = robomark("assignments", "check", tmp_path / "task", "--write-expected")
    assert (again.returncode, again.stdout.count("no changes")) == (0, 1)
    assert robomark("assignments", "check", "--all", "--write-expected").returncode == 2


def test_marks_that_are_wrong_are_not_noted(tmp_path: Path, runner: TrialRunner) -> None:
    """A reference without full marks is a mistake, and the values in a table are never overwritten."""
    create_assignment(tmp_path / "task")
    (tmp_path / "task" / "expected.toml").write_text('[stops-short]\nmarks = "1"\n')
    (tmp_path / "task" / "examples" / "reference" / "robot.py").write_text("say('red')\n")
    checked = check_examples(str(tmp_path / "task"), runner=runner)
    assert (dict(checked.missing_expectations), len(checked.problems)) == ({}, 2)
    with pytest.raises(UsageError, match=r"stops-short has a table in expected\.toml already"):
        add_expected(str(tmp_path / "task"), {"stops-short": ExpectedResult(marks=Decimal(3))})


def test_a_list_says_what_the_assignments_say() -> None:
    for name in list_catalogue_ids():
        assignment, listed = find_assignment(name), read_overview(locate_assignment_folder(name))
        assert (listed.section, listed.id, listed.title) == (assignment.section, assignment.id, assignment.title)
        assert listed.sentence.removesuffix(" …") in " ".join(assignment.description.split())
        assert (listed.marks, listed.trials) == (assignment.max_marks, sum(1 for _ in assignment.trials())), name
