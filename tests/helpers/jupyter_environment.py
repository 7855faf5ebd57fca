"""A virtual environment with the notebook's wheel and Jupyter, on another Python if there is one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from notebook_package import build_wheel

_INSTALL_SECONDS = 900


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


def create_environment(folder: Path, *packages: str) -> JupyterEnvironment:
    """Return a new environment with the wheel and its extra. The test is skipped where packages cannot be had."""
    wheel = build_wheel(folder)
    subprocess.run([find_python(), "-m", "venv", folder / "venv"], check=True, capture_output=True)
    environment = JupyterEnvironment(folder / "venv")
    install = [str(environment.python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run(
        [*install, f"{wheel}[kit]", *packages],
        capture_output=True,
        text=True,
        timeout=_INSTALL_SECONDS,
        check=False,
    )
    if done.returncode:
        pytest.skip(f"the packages cannot be installed here: {done.stderr.strip()[-300:]}")
    return environment


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
