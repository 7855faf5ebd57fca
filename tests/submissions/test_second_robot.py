"""Assignments with two robots: valid and refused tables, and the programs that a submission must contain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from sim.errors import AssignmentError, UsageError
from sim.recording import Pose
from submissions.assignment.definition import Assignment, Parts
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission
from submissions.stored_submission import pack_submission, unpack_submission

HEAD = 'id = "a"\ntitle = "A"\n'
WORLD = "[world]\nrobots = 2\n"
SCENARIO = '[[scenario]]\nid = "s"\nposes = [[100, 800, 0], [200, 800, 0]]\n'
SECOND = "second_poses = [[900, 800, 180]]\n"
CRITERION = '[[criterion]]\ntitle = "Ends"\nmarks = 1\ncheck = "finishes"\n'
APART = CRITERION.replace("finishes", "apart") + "at_most = 200\n"
PARTS = '[parts]\nsecond_program = "same"\n'


def written(folder: Path, text: str, files: Mapping[str, str] | None = None) -> Assignment:
    (folder / "assignment.toml").write_text(text)
    for name, content in (files or {}).items():
        (folder / name).write_text(content)
    return read_assignment(folder)


def test_a_second_pose_stands_for_all_and_has_a_jitter_of_its_own(tmp_path: Path) -> None:
    one = written(tmp_path, HEAD + WORLD + SCENARIO + SECOND + CRITERION)
    assert [trial.second_pose for trial in one.trials()] == [Pose(900, 800, 180)] * 2
    assert one.parts.second_program == "student"
    moved = written(tmp_path, HEAD + WORLD + SCENARIO + SECOND + "start_jitter = [10, 10, 5]\n" + CRITERION)
    alone = written(tmp_path, HEAD + SCENARIO + "start_jitter = [10, 10, 5]\n" + CRITERION)
    for trial, same in zip(moved.trials(), alone.trials(), strict=True):
        assert trial.pose == same.pose
        assert trial.second_pose is not None
        assert 0 < abs(trial.second_pose.x - 900) <= 10
        assert trial.second_pose.x - 900 != pytest.approx(trial.pose.x - (100 + 100 * trial.place))
    assert alone.parts.second_program == "none"
    assert all(trial.second_pose is None for trial in alone.trials())


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        (HEAD + WORLD + SCENARIO + CRITERION, ":5: second_poses is missing"),
        (HEAD + SCENARIO + SECOND + CRITERION, ":6: second_poses is given, expected robots = 2"),
        (HEAD + PARTS + SCENARIO + CRITERION, ":4: second_program is given, expected robots = 2"),
        (HEAD + WORLD + SCENARIO + "second_poses = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]\n", "expected one, or 2"),
        (HEAD + WORLD + SCENARIO + "second_poses = [[-1, 2, 3]]\n" + CRITERION, "second_poses[0] is off the floor"),
        (HEAD + WORLD.replace("2", "3") + SCENARIO + SECOND + CRITERION, "robots is 3, expected 1 or 2"),
        (HEAD + WORLD + PARTS.replace("same", "none") + SCENARIO + SECOND + CRITERION, 'expected "student", "same"'),
        (HEAD + WORLD + PARTS.replace("same", "x.py") + SCENARIO + SECOND + CRITERION, 'second_program is "x.py"'),
        (HEAD + SCENARIO + CRITERION + "robot = 2\n", ":10: robot is 2, but there is only one robot"),
        (HEAD + SCENARIO + APART, "check is about two robots, but there is one"),
        (HEAD + WORLD + SCENARIO + SECOND + APART + "robot = 2\n", "check looks at both robots"),
        (HEAD + WORLD + SCENARIO + SECOND + APART + "at_least = 300\n", "has an at_most below at_least"),
        (HEAD + SCENARIO + 'channel = { link = "between robots" }\n' + CRITERION, 'expected robots = 2 in world'),
        (HEAD + WORLD + '[parts]\nresponder = "none"\n' + SCENARIO + SECOND +
         'channel = { link = "infrared", beacon = [9, 9] }\n' + CRITERION, 'expected "between robots"'),
        (HEAD + WORLD + SCENARIO + SECOND + APART.replace("at_most = 200\n", ""), "has no condition"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(tmp_path: Path, text: str, phrase: str) -> None:
    with pytest.raises(AssignmentError) as error:
        written(tmp_path, text)
    assert phrase in str(error.value)


def submitted(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).write_text(f"print({name!r})\n")
    return folder


def test_the_second_program_lies_beside_the_first(tmp_path: Path) -> None:
    parts = Parts(responder="none", second_program="student")
    submission = read_submission(submitted(tmp_path, "robot.py", "robot2.py"), required_parts=parts)
    assert submission.files["robot2.py"] == b"print('robot2.py')\n"
    assert unpack_submission(pack_submission(submission)).sha256 == submission.sha256


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (["robot.py"], "has no robot2.py, expected robot.py (a robot program) and robot2.py (the second"),
        (["robot2.py", "notes.py"], "has no robot.py"),
    ],
)  # fmt: skip
def test_a_missing_second_program_is_refused(tmp_path: Path, names: list[str], missing: str) -> None:
    with pytest.raises(UsageError) as refusal:
        read_submission(submitted(tmp_path, *names), required_parts=Parts(responder="none", second_program="student"))
    assert missing in str(refusal.value)


@pytest.mark.parametrize("who", ["same", "leader.py"])
def test_none_is_asked_for_where_the_assignment_says_what_runs(tmp_path: Path, who: str) -> None:
    parts = Parts(responder="none", second_program=who)
    assert read_submission(submitted(tmp_path, "robot.py"), required_parts=parts).program is not None
