"""What CONTRIBUTING.md shows can be added so: each example is applied to a copy of the tree and tried there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from paths import ROOT

ROOMS = ("sim", "models", "responders", "submissions", "service")
DIFFS = dict(
    re.findall(r"^### An? ([a-z ]+):.*?\n```diff\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.M | re.S)
)
#: What holds in the tree that has it, by what is added.
TRIED = {
    "criterion": """
from service.grading.judging.judge import judge_one
from submissions.criteria import SCHEMAS
assert SCHEMAS["ends_facing"].model_fields["tolerance"].default == 10
from service.grading.judging import ending
assert ending.judge_ends_facing.schema is SCHEMAS["ends_facing"]
""",
    "floor": """
from sim.floors import floor, names
assert "Cross" in names()
assert (floor("Cross").pixels[571, 5] == 0).all() and (floor("Cross").pixels[5, 5] == 255).all()
""",
    "output format": """
from service.reports.formats import FORMATS
assert FORMATS["markdown"].suffix == ".md" and FORMATS["markdown"].document is not None
""",
    "sensor": """
from responders.code import Code
from responders.trial_spec import ProgramSpec, TrialSpec
from responders.channel import Channel
from responders.sandbox.running_child import ChildLimits
from service.grading.trial_runner import TrialRunner
from sim.floors import floor
from sim.recording import Pose
from sim.robot import robot
from sim.world import Noise
text = "from ev3dev2.sensor.lego import CompassSensor\\nprint(CompassSensor(INPUT_4).bearing)"
program = ProgramSpec(Code("robot.py", text), "preloaded", ChildLimits(2, 128 << 20), 1000)
spec = TrialSpec(program=program, responder=None, collaborative=False, floor=floor("Empty_Map"),
                 robot=robot("Default_Robot"), pose=Pose(500, 500, 30), noise=Noise(), channel=Channel(),
                 seconds=5, seed=1, child_seed=1)
with TrialRunner() as runner:
    recording = runner.run(spec)
assert [line.text for line in recording.printed] == ["60"], recording.faults
""",
    "model family": """
from models.tasks import tasks
assert "square" in tasks()
""",
}


def test_each_thing_has_an_example() -> None:
    assert DIFFS.keys() == TRIED.keys()


@pytest.mark.parametrize("added", sorted(TRIED))
def test_an_example_can_be_added_so(added: str, tmp_path: Path) -> None:
    for room in ROOMS:
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__", "catalogue"))
    applied = subprocess.run(
        ["git", "apply", "--unidiff-zero", "-"],
        cwd=tmp_path,
        input=DIFFS[added],
        text=True,
        capture_output=True,
        check=False,
    )
    assert applied.returncode == 0, applied.stderr
    tried = subprocess.run(
        [sys.executable, "-c", TRIED[added]],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert tried.returncode == 0, tried.stderr
