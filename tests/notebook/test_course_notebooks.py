"""The course's robot notebooks in real kernels with a real engine: the messaging notebook itself, and stand-ins.

A stand-in has the calls, flags and libraries of its notebook, with the programs and responders of the catalogue's
reference solutions, which the tests grade elsewhere.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from models import load_weights
from notebook_builder import MESSAGING
from notebook_package import run_notebook, text_of
from service.grading.standalone_runs import RunOptions
from service.grading.standalone_runs import run_notebook as execute_notebook
from service.grading.trial_runner import TrialRunner
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import list_catalogue_ids
from submissions.assignment.reader import find_assignment
from submissions.notebook import read_notebook

pytestmark = pytest.mark.long

NETWORK = "mlp_shapes_14x14.joblib"
HEAD = "from nbev3devsim.load_nbev3devwidget import roboSim, eds\n%load_ext nbev3devsim"
LOAD = "%load_ext robomark_notebook"
#: The 29 notebooks that run robots.
NOTEBOOKS = (
    *("01.3", "01.4", "01.5", "02.1", "02.2", "02.3", "02.4", "03.1", "03.2", "03.3", "03.4", "03.5", "03.6"),
    *("04.1", "04.2", "04.3", "05.1", "05.2", "05.3", "05.4", "05.5", "05.6", "06.1", "06.3", "06.4"),
    *("08.1", "08.2", "08.4", "08.5"),
)
#: What else the cells of a notebook call.
CALLS = {
    "02.4": "df = %sim_data\nassert list(df.columns)[-1] == 'time', df",
    "04.1": """
from nn_tools.sensor_data import report_light_sensor
state = %sim_robot_state
report_light_sensor(state)
""",
    "05.3": "df = %sim_data\ndf.pivot_table(index='time', columns='variable', values='value')",
    "05.5": "df = %sim_data\nassert len(df) >= 100\n%sim_data --clear\nassert len(roboSim.results_log) == 0",
    "08.2": """
from nn_tools.sensor_data import generate_image, zoom_img
zoom_img(generate_image(roboSim.image_data(), 0))
""",
    "08.4": """
from nbev3devsim.load_nbev3devwidget import tqdma
from nn_tools.sensor_data import get_sensor_image_pair
left, right = get_sensor_image_pair(roboSim.image_data(), -1)
assert left.size == (14, 14)
""",
}


def assignments_of(number: str) -> list[Assignment]:
    """Return the assignments of the catalogue for a notebook, without those that need files of a run before."""
    catalogue = (find_assignment(name) for name in list_catalogue_ids())
    return [each for each in catalogue if number in re.findall(r"\d\d\.\d", each.section) and each.training is None]


def cells_of(assignment: Assignment) -> Iterator[str]:
    """Yield the cells for one assignment: its responder, and its program at the first visible start."""
    folder = locate_examples(assignment.id) / "reference"
    if not (folder / "robot.py").exists():
        return
    if (folder / "responder.py").exists():
        yield "roboSim.pyresponder = None\n" + (folder / "responder.py").read_text()
    line, _, body = (folder / "robot.py").read_text().partition("\n")
    if not line.startswith("%%"):
        line, body = "%%sim_magic_preloaded", f"{line}\n{body}"
    scenario = assignment.scenarios[0]
    pose = scenario.poses[0]
    flags = f"-b {assignment.world.background} -x {pose.x:.0f} -y {pose.y:.0f} -a {pose.heading % 360:.0f}"
    yield f"{line.split()[0]} {flags} -ROAHWZ --collab\n{body}"


def outputs_of(executed: Any) -> str:
    return "\n".join(text_of(cell) for cell in executed.cells).replace("\r\n", "\n")


def write_files(assignment: Assignment, folder: Path) -> None:
    """Write the files that students have beside the notebook: the given ones, and those of the reference solution."""
    for name, content in assignment.given.items():
        (folder / name).write_bytes(content)
    for path in (locate_examples(assignment.id) / "reference").iterdir():
        if path.is_file() and path.name not in ("robot.py", "responder.py"):
            shutil.copy(path, folder)


@pytest.mark.parametrize("number", NOTEBOOKS)
def test_a_stand_in_runs_from_top_to_bottom(number: str, package: Path, tmp_path: Path) -> None:
    (tmp_path / NETWORK).write_bytes(load_weights("shapes"))
    given = assignments_of(number)
    assert given, "the catalogue has an assignment for each of them"
    for assignment in given:
        write_files(assignment, tmp_path)
    programs = [cell for assignment in given for cell in cells_of(assignment)]
    executed = run_notebook(tmp_path, package, [LOAD, HEAD, *programs, *([CALLS[number]] if number in CALLS else [])])
    text = outputs_of(executed)
    runs = len(re.findall(r"^Robot run of ", text, re.MULTILINE))
    assert runs == sum(cell.startswith("%%") for cell in programs) > 0
    assert "Traceback" not in text


def test_the_messaging_notebook_runs_from_its_own_cells_with_the_recordings_of_the_command(
    package: Path, tmp_path: Path, runner: TrialRunner
) -> None:
    (tmp_path / NETWORK).write_bytes(load_weights("shapes"))
    shutil.copy(MESSAGING, tmp_path)
    cells = [
        "".join(cell["source"]) for cell in json.loads(MESSAGING.read_text())["cells"] if cell["cell_type"] == "code"
    ]
    executed = run_notebook(tmp_path, package, [LOAD, *cells])
    text = outputs_of(executed)
    assert len(re.findall(r"^Robot run of ", text, re.MULTILINE)) == 7
    assert "Python saw >> 0 << that..." in text
    assert "Last Python message was ...Py saw: 4" in text
    assert len(re.findall(r"Is that a (square|diamond|\w+ facing triangle)", text)) >= 1
    # The log that the notebook's own logger wrote, as the cell shows it.
    assert "Received message: 0\nResponse: Python saw >> 0 << that..." in text
    assert_same_recordings(text, runner)


def assert_same_recordings(text: str, runner: TrialRunner) -> None:
    """Assert that runs without chance have the recordings of ``robomark run``, with the same answers."""
    notebook = read_notebook(MESSAGING.read_bytes(), MESSAGING.name).notebook
    executed = execute_notebook(notebook, {NETWORK: load_weights("shapes")}, RunOptions(), runner)
    expected = [run.recording.sha256[:12] for run in executed.runs]
    assert re.findall(r"\(recording (\w+)\)", text) == expected
