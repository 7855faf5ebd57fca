"""Running without the sandbox: only with an explicit option, with a warning, and recorded in every grade."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from builders import settings_in
from command import robomark
from processes import robomark as robomark_meanwhile
from processes import until
from service.queue.live_workers import is_worker_running
from submissions.assignment.examples import locate_examples

_STAMP = "process limits only"
_FLAG = "--unsafe-no-sandbox"
_REFERENCE = locate_examples("echo-responder") / "reference"


@pytest.mark.parametrize("flags", [(), (_FLAG,)], ids=["sandbox", "none"])
def test_a_run_without_sandbox_says_so(flags: tuple[str, ...], tmp_path: Path) -> None:
    program, trace = tmp_path / "robot.py", tmp_path / "trace.json"
    program.write_text("import os\nprint(len(os.listdir('/')) > 3)\n")
    ran = robomark("run", program, "--trace", trace, *flags)
    document = json.loads(trace.read_text())
    assert (document["sandbox"] == _STAMP) == bool(flags)
    assert ("NO SANDBOX" in ran.stderr) == bool(flags)
    assert [text for _, text in document["printed"]] == ["True"] * len(flags)


@pytest.mark.parametrize("flags", [(), (_FLAG,)], ids=["sandbox", "none"])
def test_a_grade_without_sandbox_says_so(flags: tuple[str, ...]) -> None:
    ran = robomark("grade", _REFERENCE, "-a", "echo-responder", *flags)
    assert ran.returncode == 0, ran.stderr
    assert (f"sandbox: {_STAMP}\n" in ran.stdout) == bool(flags)
    assert ("NO SANDBOX" in ran.stderr) == bool(flags)


@pytest.mark.long
def test_a_worker_without_sandbox_says_so_in_every_grade(tmp_path: Path) -> None:
    """The environment variable of such a setting has no effect on the next worker."""
    settings = settings_in(tmp_path)
    home: dict[str, Any] = {
        "ROBOMARK_HOME": str(settings.home),
        "ROBOMARK_UNSAFE_NO_SANDBOX": "1",
        "ROBOMARK_NO_WALLS": "1",
    }
    for number, flags in enumerate(((_FLAG,), ())):
        folder = tmp_path / f"class{number}"
        shutil.copytree(_REFERENCE, folder / f"student{number}")
        with robomark_meanwhile("worker", *flags, **home) as worker:
            until(lambda: is_worker_running(settings))
            submitted = robomark("batch", "submit", folder, "-a", "echo-responder", "--wait", **home)
            worker.terminate()
            worker.wait()
        assert submitted.returncode == 0, submitted.stderr
        output = robomark("show", _grade_id(submitted.stdout), **home)
        assert (f"sandbox: {_STAMP}\n" in output.stdout) == bool(flags)


def _grade_id(table: str) -> str:
    """Return the id in the last column of the only line."""
    return next(line.split()[-1] for line in table.splitlines() if line.startswith("student") and "10 / 10" in line)
