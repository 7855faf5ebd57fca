"""Mistyped command lines: one sentence, the right status, and no terminal escapes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from builders import accept_one, opened
from command import robomark, robomark_anew
from report_builders import faulty_grade
from service.cli import main
from service.reports.formats import FORMATS
from service.settings import Settings
from service.store.grades import results
from service.store.queue import jobs
from submissions.assignment.folder import locate_assignment_folder


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("gread", "no such command 'gread'. Did you mean 'grade'"),
        ("run", "missing argument 'program'"),
        ("run x.py -Q", "no such option: -Q"),
        ("run x.py -x", "requires an argument"),
        ("run x.py --seconds nan", "invalid value for '--seconds'"),
        (
            "grade x --format foo",
            f"'foo' is not one of {', '.join(repr(name) for name, form in FORMATS.items() if form.document)}",
        ),
        ("grade x --language xx", "'xx' is not one of 'en', 'de'"),
        ("grade nothing-there -a echo-responder", "nothing-there: does not exist"),
        ("run x.py --picture out.gif", "--picture out.gif: expected a name that ends in .png"),
        ("grade x -a /usr", "/usr: has no assignment.toml in it"),
        ("grade x -a echo-responder --report /proc/x", "the folder /proc/x cannot be used for reports"),
        (
            "batch submit x -a echo-responder --output /dev/null",
            "/dev/null cannot be used for reports: it is no folder",
        ),
        ("run x.py --loss 2", "loss is 2.0, expected at most 1"),
        ("run x.py --range 300", 'the channel has range and no link that it limits, expected link = "infrared"'),
        ("run x.py --link infrared", "no beacon, expected beacon = [x, y] beside it"),
        ("run x.py --link radio", 'link is "radio", expected "cable", "infrared" or "between robots"'),
        ("run x.py --beacon here", "--beacon is here, expected X,Y such as 1200,600"),
        ("run \x1b[31mx", "\\x1b[31mx cannot be read"),
    ],
)
def test_what_is_mistyped_gets_one_sentence(
    line: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["robomark", *line.split(" ")])
    with pytest.raises(SystemExit) as ended:
        main()
    captured = capsys.readouterr()
    assert (ended.value.code, captured.out) == (2, "")
    assert captured.err.startswith("robomark: ")
    assert words in captured.err
    assert captured.err.count("\n") == 1
    assert "\x1b" not in captured.err


def test_a_reader_that_goes_away_is_no_error_of_ours() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = robomark_anew("assignments", "list", out=writing)
    finally:
        os.close(writing)
    assert (ended.returncode, ended.stderr) == (130, "")


def test_a_full_disk_is_said_in_a_sentence() -> None:
    with Path("/dev/full").open("w") as full:
        ended = robomark_anew("assignments", "list", out=full.fileno())
    assert (ended.returncode, ended.stderr) == (
        3,
        "robomark: the operating system reported an error: No space left on device\n",
    )


def test_every_flag_of_the_magic_is_taken(tmp_path: Path) -> None:
    program = tmp_path / "robot.py"
    program.write_text("print(1)")
    flags = "-HWZ --angle -90 -b Nowhere -N 200 -M 1 -r Small_Robot -o Wall -s roboSim -uCcOAzXDiRvLSmFp --pencolor red"
    ended = robomark("run", program, *flags.split(" "))
    assert ended.returncode == 0
    assert [line.partition(":")[0] for line in ended.stderr.splitlines()] == ["note"] * 3
    assert ended.stdout.rstrip().endswith("; completed")


@pytest.mark.long
def test_text_is_printed_whatever_the_locale(tmp_path: Path) -> None:
    program = tmp_path / "robot.py"
    program.write_text('print("robot \\U0001f916")')
    ended = robomark_anew("run", program, PYTHONIOENCODING="latin-1")
    assert r"robot \U0001f916" in ended.stdout
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_title_is_no_markup_and_no_escape(tmp_path: Path) -> None:
    text = (locate_assignment_folder("echo-responder") / "assignment.toml").read_text()
    title = 'title = "Echo what the robot says"'
    assert title in text
    (tmp_path / "assignment.toml").write_text(text.replace(title, r'title = "[/] [bold]x \u001b[31m"'))
    ended = robomark("assignments", "show", tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith(r"[/] [bold]x \x1b[31m (echo-responder), 10 marks")


_HEAVY = {"numpy", "matplotlib", "pybullet", "celery", "redis", "sklearn", "pandas", "PIL", "re2", "alembic"}
_ASKING = {
    "--help": _HEAVY | {"sqlalchemy", "pydantic", "rich"},
    "--version": _HEAVY | {"sqlalchemy", "pydantic", "rich"},
    "batch --help": _HEAVY | {"sqlalchemy", "rich"},
    "assignments list": _HEAVY | {"sqlalchemy", "pydantic"},
    "models list": _HEAVY | {"sqlalchemy"},
    "models compare digits digits-28": _HEAVY | {"sqlalchemy"},
    "assignments show echo-responder": {"matplotlib", "sklearn", "pandas", "celery", "sqlalchemy", "alembic"},
    "batch list": _HEAVY | {"pydantic"},
    "batch status nothing": _HEAVY | {"pydantic"},
    "show nothing": _HEAVY | {"pydantic"},
    "course policy": _HEAVY | {"pydantic"},
    "db upgrade": _HEAVY,
    **{
        f"{line} --help": _HEAVY
        for line in ("run", "grade", "verify", "up", "worker", "doctor", "floors", "demo", "sandbox check",
                     "batch submit", "batch similar", "batch luck", "batch export", "batch regrade", "batch pause",
                     "assignments check", "db purge")
    },
}  # fmt: skip


@pytest.mark.long
def test_what_only_asks_imports_nothing_heavy(tmp_path: Path) -> None:
    """Each line runs in a separate process, forked from one that has imported none of our modules."""
    with opened(Settings(home=tmp_path)) as store:
        graded = accept_one(store).job_id
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        jobs.finish_job(store, claim, results.prepare_grade(faulty_grade()), datetime.now(UTC))
    asking = {**_ASKING, f"show {graded}": _HEAVY | {"pydantic"}}
    ended = subprocess.run(
        [sys.executable, "-c", _LOADED, *asking],
        env={**os.environ, "ROBOMARK_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = json.loads(ended.stdout)
    assert {line: shared for line, each in loaded.items() if (shared := sorted(asking[line] & set(each)))} == {}
    assert loaded.keys() == asking.keys()
    assert "sqlalchemy" in loaded["batch list"]


#: Prints the imported modules at the end of each command line.
_LOADED = """
import json, os, sys, tempfile
found = {}
for line in sys.argv[1:]:
    with tempfile.TemporaryFile("w+") as modules:
        if (child := os.fork()) == 0:
            for number in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            sys.argv = ["robomark", *line.split()]
            from service.cli import main
            try:
                main()
            except SystemExit:
                json.dump(sorted({name.partition(".")[0] for name in sys.modules}), modules)
                modules.flush()
            os._exit(0)
        os.waitpid(child, 0)
        modules.seek(0)
        found[line] = json.load(modules)
print(json.dumps(found))
"""


def test_the_shell_completes_commands_of_a_group() -> None:
    ended = robomark_anew(_ROBOMARK_COMPLETE="complete_bash", COMP_WORDS="robomark batch s", COMP_CWORD="2")
    assert (ended.returncode, ended.stdout.split(), ended.stderr) == (0, ["submit", "status", "similar"], "")


@pytest.mark.long
def test_run_takes_an_image_as_its_floor_and_modules_beside(tmp_path: Path) -> None:
    Image.new("RGB", (2362, 1143), (90, 200, 30)).save(tmp_path / "own.png")
    (tmp_path / "helper.py").write_text("def red(sensor):\n    return sensor.reflected_light_intensity\n")
    program = tmp_path / "robot.py"
    program.write_text("%%sim_magic_preloaded -b Loop\nimport helper\nprint(helper.red(colorLeft))\nhelper.red(1)\n")
    ended = robomark("run", program, "-b", tmp_path / "own.png", "--picture", tmp_path / "path.png")
    assert ended.returncode == 0
    assert "0.01 s  90" in ended.stdout
    assert "x 200.0 mm, y 800.0 mm" in ended.stdout
    assert ended.stderr.rstrip().endswith("(line 2 of helper.py)")
    with Image.open(tmp_path / "path.png") as drawn:
        red, green, blue = np.asarray(drawn.convert("RGB"), int).transpose(2, 0, 1)
        assert ((green > red + 20) & (green > blue + 20)).mean() > 0.25
    small = tmp_path / "small.png"
    Image.new("RGB", (10, 10)).save(small)
    assert "it must be a PNG or JPEG of 2362 x 1143 pixels" in robomark("run", program, "-b", small).stderr


@pytest.mark.long
def test_run_says_how_long_a_responder_may_compute(tmp_path: Path) -> None:
    (tmp_path / "responder.py").write_text("while True:\n    pass\n")
    program = tmp_path / "robot.py"
    program.write_text("print('PY::0')\n")
    arguments = ("run", program, "--responder", tmp_path / "responder.py", "--responder-cpu", "0.5")
    ended = robomark(*arguments)
    assert "it computed for more than 0.5 seconds of CPU time" in ended.stderr


@pytest.mark.long
def test_one_program_is_run_over_another_and_filmed(tmp_path: Path) -> None:
    one, other = tmp_path / "robot.py", tmp_path / "other.py"
    drives = "tank_drive.on_for_seconds(SpeedPercent(30), SpeedPercent({}), 1)\n"
    one.write_text(drives.format(30) + "print('one')\n")
    other.write_text(drives.format(20) + "print('another')\n")
    replay, film = tmp_path / "run.json", tmp_path / "run.gif"
    ran = robomark("run", one, "-b", "Loop", "--replay", replay, "--over", other, "--film", film)
    assert ran.returncode == 0
    assert "another" not in ran.stdout
    (trial,) = json.loads(replay.read_text())["trials"]
    assert trial["robots"][0]["start"] == trial["over"]["robots"][0]["start"]
    assert (trial["over"]["name"], [event["text"] for event in trial["over"]["events"]]) == ("other.py", ["another"])
    assert 0 < trial["over"]["parted"] < 1
    assert film.read_bytes().startswith(b"GIF89a")
    assert "expected --replay too" in robomark("run", one, "--over", other).stderr
    notebook = tmp_path / "n.ipynb"
    cell = {"cell_type": "code", "source": "x = 1", "metadata": {}}
    notebook.write_text(json.dumps({"cells": [cell], "nbformat": 4}))
    refused = robomark("run", one, "--replay", replay, "--over", notebook)
    assert (refused.returncode, "n.ipynb is a notebook" in refused.stderr) == (2, True)
