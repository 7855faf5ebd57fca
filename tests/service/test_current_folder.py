"""A command that starts in a folder of hostile files runs none of them, and gives the same marks."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from paths import ROOT

#: Files that Python, our code, Celery and others would import or read from a current folder on their path.
MODULES = (
    *("numpy", "sim", "service", "models", "responders", "submissions", "celery", "celeryconfig", "redis", "kombu"),
    *("sitecustomize", "usercustomize", "json", "random", "typing", "structlog", "sqlalchemy", "billiard", "fastapi"),
    *("matplotlib", "pybullet", "sklearn", "joblib", "pandas", "PIL", "uvicorn", "alembic", "encodings"),
)
PACKAGES = ("models", "service", "pandas")
ECHO = ROOT / "submissions" / "catalogue" / "echo-responder" / "examples" / "reference"
#: Rows of plots and words of reports must not change either.
SETTINGS = "text.usetex: True\nfigure.facecolor: red\nfont.family: cursive\nsavefig.dpi: 7\n"


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """Return a folder with a submission, and with files that record that they were executed."""
    folder = tmp_path / "downloads"
    folder.mkdir()
    noting = (
        f"import os\nwith open({str(tmp_path / 'ran')!r}, 'a') as file:\n    print(__name__, os.getpid(), file=file)\n"
    )
    for name in MODULES:
        if name in PACKAGES:
            (folder / name).mkdir()
            (folder / name / "__init__.py").write_text(noting)
        else:
            (folder / f"{name}.py").write_text(noting)
    (folder / "evil.pth").write_text(f"import sys; open({str(tmp_path / 'ran')!r}, 'a').write('pth')\n")
    (folder / "matplotlibrc").write_text(SETTINGS)
    student = folder / "class" / "ada"
    student.mkdir(parents=True)
    for file in ECHO.iterdir():
        (student / file.name).write_bytes(file.read_bytes())
    return folder


def run(
    folder: Path, words: Sequence[str], starter: Sequence[str], **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*starter, *words],
        cwd=folder,
        env=os.environ | {"ROBOMARK_HOME": str(folder.parent / "home")} | environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )


def what_ran(folder: Path) -> str:
    ran = folder.parent / "ran"
    return ran.read_text() if ran.exists() else ""


COMMAND = (str(Path(sys.executable).parent / "robomark"),)
COMMANDS = {
    "grade": ["grade", "class/ada", "-a", "echo-responder"],
    "grade the folder": ["grade", ".", "-a", "echo-responder"],
    "grade with a report": ["grade", "class/ada", "-a", "echo-responder", "--report", "reports"],
    "run": ["run", "class/ada/robot.py", "--responder", "class/ada/responder.py", "--picture", "path.png"],
    "check an assignment": ["assignments", "check", "echo-responder"],
    "doctor": ["doctor"],
    "list batches": ["batch", "list"],
    "submit and wait": ["batch", "submit", "class", "-a", "echo-responder", "--wait"],
    "floors": ["floors", "Loop", "--output", "loop.png"],
    "sandbox check": ["sandbox", "check"],
}


#: Long tests: commands that start no service and differ from others only in their imports.
_LONG = ("check an assignment", "floors", "grade", "grade the folder", "list batches", "run", "sandbox check")
MARKED = ("grade", "grade with a report", "submit and wait")


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * (name in _LONG)) for name in COMMANDS])
def test_no_file_of_the_current_folder_is_run(hostile: Path, name: str) -> None:
    done = run(hostile, COMMANDS[name], COMMAND)
    assert what_ran(hostile) == ""
    if name.startswith(("grade", "run", "submit")) and name != "grade the folder":
        assert done.returncode == 0, done.stderr
    if name in MARKED:
        assert re.search(r"\b10 of 10 marks|10\.00|10 / 10", done.stdout), done.stdout


@pytest.mark.long
@pytest.mark.parametrize("path", ["", ":/nowhere", "."])
def test_services_take_no_python_settings_of_the_users(hostile: Path, path: str) -> None:
    starter = (sys.executable, "-P", "-c", "from service.cli import main; main()")
    # Files that Python reads before our first line are the user's responsibility. All processes we start are covered.
    for name in ("sitecustomize", "usercustomize", "encodings"):
        (hostile / f"{name}.py").unlink()
    shutil.rmtree(hostile / "service")
    done = run(hostile, COMMANDS["submit and wait"], starter, PYTHONPATH=path)
    assert what_ran(hostile) == ""
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_settings_for_plots_in_the_current_folder_change_no_plot(hostile: Path) -> None:
    words = ["run", "class/ada/robot.py", "--responder", "class/ada/responder.py", "--picture"]
    assert run(hostile, [*words, "with.png"], COMMAND).returncode == 0
    (hostile / "matplotlibrc").unlink()
    assert run(hostile, [*words, "without.png"], COMMAND).returncode == 0
    assert (hostile / "with.png").read_bytes() == (hostile / "without.png").read_bytes()


#: Places that start processes. All other code calls ``sim/processes.py``; the sandbox starts its own without an
#: environment of ours.
STARTERS = {
    "sim/processes.py",
    "responders/sandbox/zygote.py",
    "responders/sandbox/bubblewrap.py",
    "responders/sandbox/private_folders.py",
}
STARTS = re.compile(
    r"\bsubprocess\.(?:Popen\(|run\(|call\(|check_\w+\()|\bos\.(?:exec|spawn|posix_spawn|system|popen)\w*\("
)


def test_one_function_starts_processes() -> None:
    packages = ("sim", "models", "responders", "submissions", "service")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py") if "catalogue" not in path.parts]
    document = {str(path.relative_to(ROOT)) for path in files if STARTS.search(path.read_text())}
    inside = {name for name in document if name.startswith("responders/sandbox/inside/")}
    assert document - inside <= STARTERS
