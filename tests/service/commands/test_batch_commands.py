"""``robomark batch``, ``show``, ``doctor`` and ``db`` as users run them, in separate processes."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from sqlalchemy import func, select

from batch_command import Ended, robomark
from command import COMMAND
from service.reports.output_files import build_file_stem
from service.settings import Settings
from service.store.engine import open_store
from service.store.states import JobState
from service.store.tables.submissions import Job
from submissions.assignment.examples import locate_examples


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ended, Path]:
    """Return a home after a batch of two good submissions and a bad row, the output, and the reports' folder."""
    folder = tmp_path_factory.mktemp("batch") / "class"
    for name in ("reference", "flawed"):
        shutil.copytree(locate_examples("echo-responder") / name, folder / name)
    with (folder / "reference" / "robot.py").open("a") as program:
        # A robot that does not move has no drawing.
        program.write("tank_drive.on_for_seconds(SpeedPercent(20), SpeedPercent(20), 0.5)\n")
    (folder / "[red]odd.txt").write_text("x")
    home = tmp_path_factory.mktemp("home")
    reports = folder.parent / "reports"
    ended = robomark(home, "batch", "submit", folder, "-a", "echo-responder", "--wait", "--output", reports)
    return home, ended, reports


@pytest.mark.long
def test_a_batch_is_of_the_course_that_is_named_and_listed_there(tmp_path: Path) -> None:
    folder = tmp_path / "class"
    shutil.copytree(locate_examples("echo-responder") / "flawed", folder / "ada")
    home = tmp_path / "home"
    mistyped = robomark(home, "batch", "submit", folder, "-a", "echo-responder", "--course", "night")
    assert (mistyped.status, "there is no course called 'night'" in mistyped.err) == (2, True)
    robomark(home, "user", "add", "grace", "--course", "night")
    ended = robomark(home, "batch", "submit", folder, "-a", "echo-responder", "--course", "night", "--json")
    batch = json.loads(ended.out)["batch"]
    assert batch in robomark(home, "batch", "list", "--course", "night").out
    assert batch in robomark(home, "batch", "list").out
    other = robomark(home, "batch", "list", "--course", "day")
    assert (other.status, "there is no course called 'day'" in other.err) == (2, True)


def _batch_id(ended: Ended) -> str:
    match = re.search(r"batch (\w{12}): 2 queued", ended.out)
    assert match is not None, ended
    return match[1]


@pytest.mark.long
def test_submit_and_wait_ends_with_marks_and_reports(graded: tuple[Path, Ended, Path]) -> None:
    home, ended, reports = graded
    assert ended.status == 2
    assert "1 submission was rejected" in ended.err
    assert re.search(r"^\[red\]odd\.txt +\S", ended.out, re.MULTILINE)
    assert re.search(r"^reference +echo-responder +10 / 10 +completed +\w{12}$", ended.out, re.MULTILINE)
    odd = f"{build_file_stem('[red]odd.txt', 'refused')}.html"
    assert {path.name for path in reports.iterdir()} == {"flawed.html", "index.html", "reference.html", odd}
    assert "data:image/png;base64," in (reports / "reference.html").read_text()
    assert f"report: {reports / 'index.html'}" in ended.err
    index = (reports / "index.html").read_text()
    assert 'href="reference.html"' in index
    assert "[red]odd.txt" in index
    assert not (home / "run" / "valkey.sock").exists()


@pytest.mark.long
def test_status_list_and_export_agree(graded: tuple[Path, Ended, Path]) -> None:
    home, ended, _ = graded
    batch = _batch_id(ended)
    status = robomark(home, "batch", "status", batch[:6])
    assert status.status == 0
    assert f"batch {batch}: class: 2 done" in status.out
    assert "[red]odd.txt" in status.out
    assert batch in robomark(home, "batch", "list").out
    rows = list(csv.DictReader(io.StringIO(robomark(home, "batch", "export", batch).out)))
    odd = "[red]odd.txt"
    verdicts = {row["file"]: row["verdict"] for row in rows}
    assert verdicts == {"reference": "finished", "flawed": "finished", odd: ""}
    assert all(bool(row["reason"]) == (row["file"] == odd) for row in rows)
    exported = json.loads(robomark(home, "batch", "export", batch, "--format", "json").out)
    assert {row["student"]: row["marks"] for row in exported}["reference"] == 10


def test_show_tells_a_grade_and_writes_it(graded: tuple[Path, Ended, Path], tmp_path: Path) -> None:
    home, ended, _ = graded
    match = re.search(r"^reference .* (\w{12})$", ended.out, re.MULTILINE)
    assert match is not None
    files = ("--output", tmp_path / "out", "--replay", tmp_path / "replay.json")
    result = robomark(home, "show", match[1], *files, "--language", "de")
    assert result.status == 0
    assert "Full marks" in result.out
    images = sorted((tmp_path / "out").glob("*.png"))
    assert images
    assert all(image.read_bytes().startswith(b"\x89PNG") for image in images)
    assert "Volle Punktzahl" in (tmp_path / "out" / "reference.html").read_text()
    replay = json.loads((tmp_path / "replay.json").read_text())
    assert len(replay["trials"]) == replay["of"] > 0
    assert [source["name"] for source in replay["sources"]] == ["robot.py", "responder.py"]


@pytest.mark.long
def test_show_lays_one_grade_over_another_and_films_a_trial(graded: tuple[Path, Ended, Path], tmp_path: Path) -> None:
    home, ended, _ = graded
    reference, flawed = (
        re.search(rf"^{who} .* (\w{{12}})$", ended.out, re.MULTILINE)[1]  # type: ignore[index]
        for who in ("reference", "flawed")
    )
    film = tmp_path / "film.gif"
    result = robomark(home, "show", flawed, "--over", flawed, "--replay", tmp_path / "own.json", "--film", film)
    assert result.status == 0
    assert f"film: {film}" in result.err
    assert film.read_bytes().startswith(b"GIF89a")
    (over,) = {trial["over"]["parted"] for trial in json.loads((tmp_path / "own.json").read_text())["trials"]}
    assert over is None
    for given, sentence in (
        (("--over", reference, "--replay", tmp_path / "r.html"), "once the grade is published, not before"),
        (("--over", "before", "--replay", tmp_path / "r.html"), "no grade of the same student"),
        (("--over", flawed), "expected --replay or --output too"),
        (("--trial", "1"), "expected --film too"),
        (("--film", tmp_path / "film.mp4"), "expected a name that ends in .gif"),
    ):
        refused = robomark(home, "show", flawed, *given)
        assert (refused.status, sentence in refused.err) == (2, True), given
    assert not (tmp_path / "r.html").exists()


def test_backup_is_a_whole_database(graded: tuple[Path, Ended, Path], tmp_path: Path) -> None:
    home, ended, _ = graded
    copy = tmp_path / "copy.db"
    assert robomark(home, "db", "backup", copy).status == 0
    elsewhere = robomark(
        tmp_path / "home", "batch", "status", _batch_id(ended), ROBOMARK_DATABASE_URL=f"sqlite:///{copy}"
    )
    assert "2 done" in elsewhere.out
    again = robomark(home, "db", "backup", copy)
    assert (again.status, "exists already" in again.err) == (2, True)


@pytest.mark.long
def test_a_stopped_wait_gives_back_what_was_begun(tmp_path: Path) -> None:
    own = tmp_path / "class" / "spinner"
    shutil.copytree(locate_examples("echo-responder") / "reference", own)
    (own / "robot.py").write_text("while True:\n    pass\n")
    home = tmp_path / "home"
    submit = [*COMMAND, "batch", "submit", str(own.parent), "-a", "echo-responder", "--wait"]
    environment = {**os.environ, "ROBOMARK_HOME": str(home)}
    with subprocess.Popen(submit, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as waiting:
        while _running(home) == 0:
            assert waiting.poll() is None
            time.sleep(0.1)
        waiting.send_signal(signal.SIGINT)
        _, err = waiting.communicate(timeout=60)
    assert waiting.returncode == 130
    assert b"stay queued: robomark batch status" in err
    with open_store(Settings(home=home)) as store, store.reading() as session:
        job = session.scalars(select(Job)).one()
        assert (job.state, job.attempt, job.lease) == (JobState.QUEUED, 0, None)


def _running(home: Path) -> int:
    with open_store(Settings(home=home)) as store, store.reading() as session:
        running = select(func.count()).select_from(Job).where(Job.state == JobState.RUNNING)
        return session.scalar(running) or 0


@pytest.mark.long
def test_doctor_is_well_here_and_names_what_is_not(tmp_path: Path) -> None:
    well = robomark(tmp_path, "doctor")
    assert well.status == 0, well
    ill = robomark(tmp_path, "doctor", ROBOMARK_BROKER_URL="redis://127.0.0.1:1/0")
    assert ill.status == 3
    assert "problems: broker" in ill.err


@pytest.mark.parametrize(
    ("arguments", "status", "expected"),
    [
        (["show", "nosuchgrade"], 2, "there is no grade 'nosuchgrade'"),
        (["batch", "status", "nosuchbatch"], 2, "there is no batch 'nosuchbatch'"),
        (["batch", "submit", "nowhere", "-a", "echo-responder"], 2, "does not exist"),
    ],
)
def test_mistakes_get_one_sentence(tmp_path: Path, arguments: list[str], status: int, expected: str) -> None:
    ended = robomark(tmp_path, *arguments)
    assert ended.status == status
    assert expected in ended.err
    assert len(ended.err.strip().splitlines()) == 1


def test_a_home_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    ended = robomark(tmp_path / "file" / "home", "batch", "list")
    assert ended.status == 3
    assert "file" in ended.err
