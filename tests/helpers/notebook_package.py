"""The distribution ``robomark-notebook``, built from this tree, and kernels that have it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from notebook_builder import document
from paths import ROOT

HELPERS = ROOT / "tests" / "helpers"
#: The first cell of notebooks whose robots are the fake engine's.
FAKE_ENGINE = "import fake_engine\nfake_engine.install()\n%load_ext robomark_notebook"


def build_wheel(folder: Path) -> Path:
    """Build the wheel in a folder."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT / "notebook", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    return wheel


def unpack_package(folder: Path) -> Path:
    """Build the wheel, unpack its packages in a folder, and return that. As a distribution it stays unknown there."""
    with zipfile.ZipFile(build_wheel(folder)) as wheel:
        wheel.extractall(folder, [name for name in wheel.namelist() if ".dist-info/" not in name])
    return folder


def run_notebook(folder: Path, package: Path, cells: Sequence[str], *, allow_errors: bool = False) -> Any:
    """Run the cells in a real kernel whose current folder is ``folder``. Return the executed notebook."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.reads(json.dumps(document(cells)), as_version=4)  # type: ignore[no-untyped-call]
    client = NotebookClient(
        notebook,
        timeout=120,
        kernel_name="python3",
        allow_errors=allow_errors,
        resources={"metadata": {"path": str(folder)}},
    )
    path = os.pathsep.join([str(package), str(HELPERS)])
    with client.setup_kernel(env={**os.environ, "PYTHONPATH": path, "IPYTHONDIR": str(folder / ".ipython")}):
        for index, cell in enumerate(notebook.cells):
            client.execute_cell(cell, index)
    return notebook


def text_of(cell: Any) -> str:
    """Return the text outputs of an executed cell."""
    return "\n".join(
        output.get("text") or output.get("data", {}).get("text/plain") or output.get("evalue", "")
        for output in cell["outputs"]
    )
