"""The built wheel works in an empty environment, for a user who owns nothing else, without files from a checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from paths import ROOT

_NOBODY = 65534
#: Earlier commands in this process may have left a stricter umask.
_READABLE_FOR_OTHERS = 0o022
#: The interpreter of the tests, and the system's.
_PYTHONS = (Path(sys.executable).resolve(), Path("/usr/bin/python3.11"))


def _open_to_others(python: Path) -> bool:
    return python.exists() and all(folder.stat().st_mode & 0o001 for folder in python.parents)


@pytest.fixture(scope="module")
def installed() -> Iterator[Path]:
    """Yield the command in an environment with the wheel and its locked dependencies, without a checkout."""
    # Not in pytest's own folder: each run closes that to other users, even while this run continues.
    with tempfile.TemporaryDirectory(prefix="robomark-wheel-") as made:
        Path(made).chmod(0o755)
        yield _install(Path(made))


def _install(folder: Path) -> Path:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, umask=_READABLE_FOR_OTHERS)
    (wheel,) = folder.glob("*.whl")
    environment = folder / "environment"
    python = next((each for each in _PYTHONS if _open_to_others(each)), _PYTHONS[0])
    subprocess.run([python, "-m", "venv", environment], check=True, umask=_READABLE_FOR_OTHERS)
    pip: list[str | Path] = [environment / "bin" / "python", "-m", "pip", "install", "--quiet"]
    locked: list[str | Path] = ["--require-hashes", "-r", ROOT / "deploy" / "requirements.lock"]
    for what in (locked, ["--no-deps", wheel]):
        subprocess.run([*pip, *what], check=True, umask=_READABLE_FOR_OTHERS)
    return environment / "bin" / "robomark"


@pytest.mark.long
@pytest.mark.parametrize("user", [pytest.param(None, id="this user"), pytest.param(_NOBODY, id="nobody")])
def test_demonstration_and_doctor_run_from_the_wheel(installed: Path, user: int | None) -> None:
    if user is not None and os.geteuid() != 0:
        pytest.skip("only root can become another user")
    if user is not None and not _open_to_others((installed.parent / "python").resolve()):
        pytest.skip("no Python 3.11 here is open to others")
    base = installed.parents[2] / str(user)
    elsewhere = base / "elsewhere"
    elsewhere.mkdir(parents=True)
    if user is not None:
        for folder in (base, elsewhere):
            shutil.chown(folder, user, user)
    environment = {"PATH": os.defpath, "HOME": str(base), "ROBOMARK_HOME": str(base / "home")}

    def answer(*words: str) -> str:
        done = subprocess.run(
            [installed, *words],
            cwd=elsewhere,
            env=environment,
            user=user,
            group=user,
            extra_groups=None if user is None else [],
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, (words, done.stdout, done.stderr)
        return done.stdout

    assert "known answer" in answer("doctor")
    assert "12 / 12" in answer("demo")
    assert "Recognise a shape" in (elsewhere / "robomark-demo" / "seed.html").read_text()
