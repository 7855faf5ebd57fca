"""Cells of a notebook from their start until they show the replay: with the engine of this machine and of a server.

It measures real time, so run it on an idle machine: ``python -m benchmarks notebook_cells``.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path
from typing import Any

from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output
from traitlets.config import Config

from benchmarks.harness.running_service import start_service
from benchmarks.measurement import SECONDS, Measurement, measure_wall_seconds, median
from service.store.people import credentials, membership
from service.store.people.reach import Reach
from service.store.people.students import DEFAULT_COURSE
from service.store.states import CredentialKind
from submissions.student_identity import Student

_PROJECT = Path(__file__).parents[1] / "notebook"
_MIN_REPETITIONS = 5
_RESPONDER_CELL = """
from nbev3devsim.load_nbev3devwidget import roboSim

def answer(text):
    return "JSON::[1]"

roboSim.pyresponder = answer
"""
#: Drives for 20 s, reads a sensor all the time, and asks two questions.
_ROBOT_CELL = """%%sim_magic_preloaded -b Loop -x 500 -y 500 -a 90 -R --collab
import time

for _ in range(2):
    start = time.time()
    print("PY::light")
    while time.time() - start < 10:
        light = colorLeft.reflected_light_intensity_pc
        tank_drive.on(SpeedPercent(light / 5), SpeedPercent(20 - light / 5))
        time.sleep(0.05)
"""


def measure(times: int) -> list[Measurement]:
    """Measure the cell with both engines."""
    count = max(times, _MIN_REPETITIONS)
    with _install_extension():
        return [
            _describe("this machine", _measure_local(count), 1.0, beyond=0.4),
            _describe("a server on this machine", _measure_server(count), 1.5),
        ]


def _measure_local(count: int) -> list[float]:
    with _open_notebook({}) as shell:
        return _measure_cell(shell, count)


def _measure_server(count: int) -> list[float]:
    with ExitStack() as stack:
        store, port = start_service(stack, "", workers=1)
        with store.transaction() as session:
            person_id = membership.make_student(session, DEFAULT_COURSE, Student("ada")).person_id
            reach = Reach(scopes=frozenset({"submit", "read"}))
            token = credentials.issue_credential(
                session, person_id, CredentialKind.TOKEN, timedelta(hours=1), reach=reach
            )
        variables = {"ROBOMARK_URL": f"http://127.0.0.1:{port}", "ROBOMARK_TOKEN": token}
        return _measure_cell(stack.enter_context(_open_notebook(variables)), count)


def _describe(engine: str, seconds: list[float], budget: float, beyond: float | None = None) -> Measurement:
    what = f"notebook: cell of 20 s simulated, until it shows the replay, engine of {engine}"
    return Measurement(what, median(seconds), SECONDS, budget, beyond, details=f"most {max(seconds):.2f} s")


@contextlib.contextmanager
def _install_extension() -> Iterator[None]:
    """Make the extension importable as its wheel has it: the tree lacks the files that its build adds."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder]
        subprocess.run(command, cwd=_PROJECT, check=True, capture_output=True)
        (wheel,) = Path(folder).glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder)
        sys.path.insert(0, folder)
        yield


@contextlib.contextmanager
def _open_notebook(variables: Mapping[str, str]) -> Iterator[Any]:
    """Yield a shell with the extension and the responder, in an empty folder."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        os.environ.update(variables)
        shell: Any = InteractiveShell.instance(config=Config(HistoryManager={"enabled": False}))
        try:
            shell.run_line_magic("load_ext", "robomark_notebook")
            shell.run_cell(_RESPONDER_CELL)
            yield shell
        finally:
            InteractiveShell.clear_instance()


def _measure_cell(shell: Any, count: int) -> list[float]:
    """Return the seconds of each repetition, without those of the first, which loads the libraries."""
    return [measure_wall_seconds(lambda: _run_robot(shell)) for _ in range(count + 1)][1:]


def _run_robot(shell: Any) -> None:
    with capture_output() as captured:
        shell.run_cell(_ROBOT_CELL, store_history=True)
    if not captured.outputs:
        raise RuntimeError(f"the cell shows no replay: {captured.stdout}{captured.stderr}")
