"""A virtual environment with the notebook's wheel and Jupyter, on another Python if there is one, and its servers."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from notebook_builder import document
from notebook_package import build_wheel

_INSTALL_SECONDS, _START_SECONDS, _END_SECONDS = 600, 90, 20
_TOKEN = "a-token-of-the-tests"
_JUPYTER = ("jupyterlab>=4", "notebook>=7", "nbconvert", "ipykernel")
#: A responder, a run that ends with a fault, and a check.
CELLS = [
    "%load_ext robomark_notebook",
    "def responder(text):\n    return 'answer to ' + text",
    "%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90 -R --collab\n"
    "tank_drive.on(SpeedPercent(40), SpeedPercent(40))\n"
    "print('PY::at the start')\n"
    "while colorLeft.reflected_light_intensity_pc > 95:\n    pass\n"
    "tank_drive.off()\nsay('There it is')\nprint(undefined_name)",
    "%robomark check stop-at-black-line task.ipynb",
]
FAULT = "is not defined"


def find_python() -> Path:
    """Return the newest CPython that the wheel supports: 3.13 or 3.12 if there is one, otherwise this one."""
    for version in ("3.13", "3.12"):
        pyenv = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
        candidates = [*pyenv, *([Path(found)] if (found := shutil.which(f"python{version}")) else [])]
        for candidate in candidates:
            check = "import sys, venv, ensurepip; print(*sys.version_info[:2], sep='.')"
            done = subprocess.run([candidate, "-c", check], capture_output=True, text=True, check=False)
            if done.stdout.strip() == version:
                return candidate
    return Path(sys.executable)


@dataclass(frozen=True)
class JupyterEnvironment:
    """The virtual environment."""

    folder: Path

    @property
    def python(self) -> Path:
        """Its Python."""
        return self.folder / "bin" / "python"

    def run(self, *words: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a module of it in a folder."""
        command = [str(self.python), *words]
        environment = build_variables(folder, **variables)
        return subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
        )


def share_environment(temporary: Path) -> JupyterEnvironment:
    """Return an environment with the wheel, its extra and Jupyter, which all processes of the tests share.

    Args:
        temporary: The temporary folder of this process. Those of a parallel run are in one folder.

    The test is skipped where packages cannot be had.
    """
    shared = temporary.parent if "PYTEST_XDIST_WORKER" in os.environ else temporary
    environment = JupyterEnvironment(shared / "jupyter-environment")
    outcome = shared / "jupyter-environment.txt"
    with (shared / "jupyter-environment.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not outcome.exists():
            outcome.write_text(_install(environment, temporary))
    if problem := outcome.read_text():
        pytest.skip(f"the packages cannot be installed here: {problem}")
    return environment


def _install(environment: JupyterEnvironment, folder: Path) -> str:
    """Make the environment. Return why its packages cannot be installed; empty if they can."""
    wheel = build_wheel(folder)
    subprocess.run([find_python(), "-m", "venv", environment.folder], check=True, capture_output=True)
    install = [str(environment.python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    command = [*install, f"{wheel}[kit]", *_JUPYTER]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_INSTALL_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return f"it takes more than {_INSTALL_SECONDS} s"
    return done.stderr.strip()[-300:] if done.returncode else ""


def build_variables(folder: Path, **variables: str) -> dict[str, str]:
    """Return the environment of a Jupyter whose settings are in a folder, and whose robots are this tree's."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("JUPYTER", "PYTHON", "IPYTHON"))}
    return {
        **kept,
        "HOME": str(folder),
        "JUPYTER_CONFIG_DIR": str(folder / ".jupyter"),
        "JUPYTER_DATA_DIR": str(folder / ".jupyter-data"),
        "IPYTHONDIR": str(folder / ".ipython"),
        "ROBOMARK_COMMAND": str(Path(sys.executable).with_name("robomark")),
        **variables,
    }


@contextmanager
def serving_jupyter(
    environment: JupyterEnvironment, module: str, folder: Path, theme: str = "JupyterLab Light"
) -> Iterator[str]:
    """Yield the address of a server for the notebooks of a folder. ``module`` is ``jupyterlab`` or ``notebook``."""
    settings = folder / ".jupyter" / "lab" / "user-settings" / "@jupyterlab" / "apputils-extension"
    settings.mkdir(parents=True, exist_ok=True)
    (settings / "themes.jupyterlab-settings").write_text(json.dumps({"theme": theme}))
    (settings / "notification.jupyterlab-settings").write_text(json.dumps({"fetchNews": "false"}))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    flags = ["--no-browser", "--allow-root", "--ip=127.0.0.1", f"--port={port}", f"--IdentityProvider.token={_TOKEN}"]
    command = [str(environment.python), "-m", module, *flags, f"--ServerApp.root_dir={folder}"]
    log = folder / ".server.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            command, cwd=folder, env=build_variables(folder), stdout=output, stderr=subprocess.STDOUT
        )
    try:
        _wait_for(f"http://127.0.0.1:{port}/api/status?token={_TOKEN}", log)
        place = "lab/tree" if module == "jupyterlab" else "notebooks"
        yield f"http://127.0.0.1:{port}/{place}/task.ipynb?token={_TOKEN}"
    finally:
        process.terminate()
        try:
            process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _wait_for(url: str, log: Path) -> None:
    end = time.monotonic() + _START_SECONDS
    while time.monotonic() < end:
        with contextlib.suppress(OSError), urllib.request.urlopen(url, timeout=5):
            return
        time.sleep(0.3)
    pytest.fail(f"the server does not start:\n{log.read_text()[-2000:]}")


def write_task(folder: Path, cells: list[str] = CELLS) -> Path:
    """Write a notebook with the cells, ``task.ipynb`` in the folder."""
    path = folder / "task.ipynb"
    head = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    path.write_text(json.dumps({**document(cells), "metadata": head}))
    return path
