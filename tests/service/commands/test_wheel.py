"""The built wheel works in an empty folder: it carries weights, catalogue, examples, templates and migrations."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from paths import ROOT


@pytest.mark.long
def test_the_demonstration_runs_from_the_wheel(tmp_path: Path) -> None:
    wheels, installed, elsewhere = tmp_path / "wheels", tmp_path / "installed", tmp_path / "elsewhere"
    elsewhere.mkdir()
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(wheels)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = wheels.glob("*.whl")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(installed), str(wheel)]
    subprocess.run(install, check=True, capture_output=True)
    environment = os.environ | {"PYTHONPATH": str(installed), "ROBOMARK_HOME": str(tmp_path / "home")}
    where = "import sim, service.cli; print(sim.__file__); service.cli.main()"
    done = subprocess.run(
        [sys.executable, "-c", where, "demo"],
        cwd=elsewhere,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(installed))
    assert "12 / 12" in done.stdout
    report = (elsewhere / "robomark-demo" / "seed.html").read_text()
    assert "Recognise a shape" in report
