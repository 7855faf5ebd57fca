"""From a platform's download to the file for its upload, as users do it: one row each, with the right name."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

from batch_command import robomark
from moodle_rules import feedback_taken_by_moodle, imported_by_moodle
from service.settings import Settings
from service.store.engine import open_store
from service.store.queue import workers
from service.store.queue.workers import WorkerDescription
from submissions.assignment.examples import locate_examples

ECHO = "echo-responder"
REFERENCE = locate_examples(ECHO) / "reference"
WORKSHEET = """\
Identifier,Full name,Email address,Status,Grade,Maximum Grade,Last modified (grade),Feedback comments
Participant 500000,Ada Lovelace,ada@uni.example,Submitted,,10.00,-,
Participant 500001,Alan Turing,alan@uni.example,Submitted,,10.00,-,
Participant 500002,Zoë Ångström,zoe@uni.example,Submitted,,10.00,-,
"""


@pytest.fixture
def download(tmp_path: Path) -> Path:
    """Return a download: Ada submitted all files, Alan no responder, Zoë a document."""
    path = tmp_path / "CS101-Echo-77.zip"
    robot, responder = ((REFERENCE / name).read_text() for name in ("robot.py", "responder.py"))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Ada Lovelace_500000_assignsubmission_file/robot.py", robot)
        archive.writestr("Ada Lovelace_500000_assignsubmission_file/responder.py", responder)
        archive.writestr("Alan Turing_500001_assignsubmission_file/robot.py", robot)
        archive.writestr("Zoë Ångström_500002_assignsubmission_file/report.docx", "x")
    (tmp_path / "worksheet.csv").write_text(WORKSHEET, encoding="utf-8")
    return path


@pytest.mark.long
def test_a_download_of_moodles_becomes_its_worksheet_and_feedback(download: Path, tmp_path: Path) -> None:
    home, sheet, reports = tmp_path / "home", tmp_path / "worksheet.csv", tmp_path / "reports"
    words: list[str | Path] = [
        "batch",
        "submit",
        download,
        "-a",
        ECHO,
        "--people",
        sheet,
        "--wait",
        "--output",
        reports,
    ]
    ended = robomark(home, *words)
    assert ended.status == 2
    match = re.search(r"batch (\w{12}): 2 queued", ended.out)
    assert match is not None, ended
    status = robomark(home, "batch", "status", match[1]).out
    for row in (
        r"^Ada Lovelace .* 10 / 10 +completed",
        r"^Alan Turing .* 6 / 10 +completed; no responder\.py",
        r"^Zoë Ångström .* rejected: Zoë Ångström_500002_assignsubmission_file: has no robot\.py or responder\.py",
    ):
        assert re.search(row, status, re.MULTILINE), status
    filled, feedback = tmp_path / "filled.csv", tmp_path / "feedback.zip"
    export = ("batch", "export", match[1], "--format")
    assert robomark(home, *export, "moodle-worksheet", "--worksheet", sheet, "-o", filled).status == 0
    grades = imported_by_moodle(filled.read_text("utf-8"))
    assert {number: grade for number, (grade, _) in grades.items()} == {"500000": 10, "500001": 6, "500002": None}
    assert "Not graded: has no robot.py" in grades["500002"][1]
    assert robomark(home, *export, "moodle-feedback", "-o", feedback).status == 0
    with zipfile.ZipFile(feedback) as archive:
        assert set(feedback_taken_by_moodle(archive)) == {"500000", "500001", "500002"}
        pages = {name: archive.read(name).decode() for name in archive.namelist()}
    assert all("<!doctype html>" in page for page in pages.values())
    index = (reports / "index.html").read_text()
    links = re.findall(r'href="([^"]+)"', index)
    assert len(links) == len(set(links)) == 3
    assert robomark(home, *export, "moodle-feedback").status == 2
    assert robomark(home, *export, "csv", "--worksheet", sheet).status == 2


def test_submitting_says_whether_a_worker_runs(download: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    alone = robomark(home, "batch", "submit", download, "-a", ECHO)
    assert "no worker is running; start one with robomark worker" in alone.err
    with open_store(Settings(home=home)) as store:
        for name in ("one", "two"):
            workers.record_heartbeat(store, WorkerDescription(name, "here", 3, "0", "all"))
    helped = robomark(home, "batch", "submit", download, "-a", ECHO, "--again")
    assert "2 workers grade them, concurrency 6" in helped.err


def test_several_are_one_document_that_names_student_and_file(tmp_path: Path) -> None:
    lone, empty = tmp_path / "alan", tmp_path / "zoe"
    for folder in (lone, empty):
        folder.mkdir()
    shutil.copy(REFERENCE / "robot.py", lone)
    paths = [str(REFERENCE), str(lone), str(empty)]
    graded = {
        form: robomark(tmp_path / "home", "grade", *paths, "-a", ECHO, "--format", form)
        for form in ("json", "gradescope")
    }
    assert {ended.status for ended in graded.values()} == {2}
    plain = json.loads(graded["json"].out)
    assert [(row["student"], row["file"], row["marks"]) for row in plain] == [
        ("reference", paths[0], 10), ("alan", paths[1], 6), ("zoe", paths[2], None),
    ]  # fmt: skip
    assert plain[2]["reason"].startswith("has no files in it")
    for_gradescope = json.loads(graded["gradescope"].out)
    assert [(row["extra_data"]["student"], row["extra_data"]["file"]) for row in for_gradescope] == [
        ("reference", paths[0]), ("alan", paths[1]), ("zoe", paths[2]),
    ]  # fmt: skip
    assert [row.get("score") for row in for_gradescope] == [10, 6, None]


@pytest.mark.long
def test_the_autograder_writes_what_gradescope_reads(tmp_path: Path) -> None:
    """The folders are those of Gradescope's harness: source, submission and results below a folder with the script."""
    home, root = tmp_path / "home", tmp_path / "autograder"
    made = robomark(home, "assignments", "autograder", ECHO, "--output", root / "source")
    assert made.status == 0, made
    assert {path.name for path in (root / "source").iterdir()} == {"setup.sh", "run_autograder", "assignment", "secret"}
    assert not (root / "source" / "assignment" / "examples").exists()
    assert (root / "source" / "secret").stat().st_mode & 0o077 == 0
    shutil.copy(root / "source" / "run_autograder", root)
    for folder in ("submission", "results"):
        (root / folder).mkdir()
    (root / "submission" / "report.docx").write_text("x")
    refused = _autograded(root)
    assert (refused["score"], "has no robot.py or responder.py" in refused["output"]) == (0, True)
    (root / "submission" / "report.docx").unlink()
    shutil.copy(REFERENCE / "robot.py", root / "submission")
    graded = _autograded(root)
    assert (graded["score"], sum(test["max_score"] for test in graded["tests"])) == (6, 10)
    (root / "source" / "assignment" / "assignment.toml").write_text("id = ")
    ended = _run(root)
    # An instructor's mistake does not change any marks.
    assert ended.returncode != 0
    assert not (root / "results" / "results.json").exists()


def _autograded(root: Path) -> dict[str, Any]:
    ended = _run(root)
    assert ended.returncode == 0, ended.stderr
    results = root / "results" / "results.json"
    read: dict[str, Any] = json.loads(results.read_text())
    results.unlink()
    return read


def _run(root: Path) -> subprocess.CompletedProcess[str]:
    own = {name: value for name, value in os.environ.items() if not name.startswith("ROBOMARK_")}
    environment = own | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    return subprocess.run(
        [root / "run_autograder"], env=environment, capture_output=True, text=True, timeout=120, check=False
    )
