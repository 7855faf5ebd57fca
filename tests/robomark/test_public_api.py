"""The public Python API: its exports, its agreement with the command's grades, and the documented scripts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import robomark
from command import robomark as command
from paths import ROOT
from submissions.assignment.examples import locate_examples

DOCUMENT = (ROOT / "docs" / "python.md").read_text()
SCRIPTS = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
PROGRAM = "%%sim_magic_preloaded -b Simple_Shapes\ntank_drive.on_for_seconds(50, 50, 1)\nprint('PY::hello')\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the input of the documented scripts."""
    for name in ("reference", "flawed"):
        shutil.copytree(locate_examples("echo-responder") / name, tmp_path / "my-work" / name)
    (tmp_path / "robot.py").write_text(PROGRAM)
    done = command("run", tmp_path / "robot.py", "--replay", tmp_path / "my-report.html")
    assert done.returncode == 0, done.stderr
    return tmp_path


def test_the_exported_names_are_these() -> None:
    assert robomark.__all__ == [
        *("Assignment", "CriterionResult", "Grade", "Grader", "HostError", "Recording", "RobomarkError", "Submission"),
        *("TrialResult", "UsageError", "Verdict", "__version__", "grade", "load_assignment", "load_submission"),
        *("read_replay", "render_report", "run_program"),
    ]
    assert all(hasattr(robomark, name) for name in robomark.__all__)
    assert (Path(robomark.__file__).parent / "py.typed").exists()


def test_every_exported_name_is_documented() -> None:
    table = DOCUMENT.partition("## All names")[2]
    for name in robomark.__all__:
        assert name == "__version__" or f"`{name}" in table, name


@pytest.mark.long
def test_every_documented_script_runs(folder: Path) -> None:
    assert len(SCRIPTS) == 3
    output = ""
    for script in SCRIPTS:
        done = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        output += done.stdout
    assert "reference 10.00 of 10" in output
    assert "finished Pose(" in output
    assert "PY::hello" in output
    for name in ("reference", "flawed"):
        assert "echo" in (folder / f"{name}.html").read_text().lower()


def test_it_grades_as_the_command_does(folder: Path) -> None:
    assignment = robomark.load_assignment("echo-responder")
    grade = robomark.grade(robomark.load_submission(folder / "my-work" / "flawed", assignment), assignment)
    result = command("grade", folder / "my-work" / "flawed", "-a", "echo-responder", "--format", "json")
    document = json.loads(result.stdout)
    assert float(grade.marks) == document["marks"]
    assert [trial.recording.sha256 for trial in grade.trials] == [trial["sha256"] for trial in document["trials"]]


@pytest.mark.long
def test_a_replay_is_read_from_its_page_and_from_its_data(folder: Path) -> None:
    command("run", folder / "robot.py", "--replay", folder / "run.json")
    assert robomark.read_replay(folder / "run.json") == robomark.read_replay(folder / "my-report.html")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("no.html", b"<p>a page"),
        ("no.html", b'<script type="application/json">{}</script>'),
        ("no.html", b'<script type="application/json">{"deflated": "AAAA"}</script>'),
        ("no.html", b'<script type="application/json">{"deflated": 3}</script>'),
        ("no.json", b'{"format": "another"}'),
        ("no.json", b"["),
        ("no.json", b"\xff"),
        ("no.json", b"[" * 100_000),
    ],
)
def test_what_is_no_replay_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(robomark.UsageError, match=r"no\.\w+ is not a replay; expected a file that"):
        robomark.read_replay(tmp_path / name)


def test_what_cannot_be_loaded_is_refused_with_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(robomark.UsageError, match="no-such-assignment"):
        robomark.load_assignment("no-such-assignment")
    with pytest.raises(robomark.UsageError, match="nowhere"):
        robomark.load_submission(tmp_path / "nowhere", robomark.load_assignment("echo-responder"))
    with pytest.raises(robomark.UsageError, match=r"robot\.py cannot be read"):
        robomark.run_program(tmp_path / "robot.py")
    with pytest.raises(robomark.UsageError, match="--nonsense"):
        robomark.run_program(tmp_path / "robot.py", "--nonsense")
