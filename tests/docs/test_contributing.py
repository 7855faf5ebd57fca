"""The examples in CONTRIBUTING.md work: each one is applied to a copy of the tree and tested there."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from paths import ROOT
from service.store.revision import find_newest_revision

ROOMS = ("sim", "models", "responders", "submissions", "service")
DIFFS = dict(
    re.findall(r"^### An? ([a-z, ]+):.*?\n```diff\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.M | re.S)
)
#: Assertions that hold after each addition.
TRIED = {
    "criterion": """
from service.grading.judging.judge import judge_one
from submissions.criteria import SCHEMAS
assert SCHEMAS["ends_facing"].model_fields["tolerance"].default == 10
from service.grading.judging import ending
assert ending.judge_ends_facing.schema is SCHEMAS["ends_facing"]
""",
    "floor": """
from sim.floors import build_floor, list_floor_names
assert "Cross" in list_floor_names()
assert (build_floor("Cross").pixels[571, 5] == 0).all() and (build_floor("Cross").pixels[5, 5] == 255).all()
""",
    "output format": """
from service.reports.formats import FORMATS
assert FORMATS["markdown"].suffix == ".md" and FORMATS["markdown"].document is not None
""",
    "sensor": """
from responders.source_file import SourceFile
from responders.trial_spec import ProgramSpec, TrialSpec
from responders.channel import Channel
from responders.sandbox.running_child import ChildLimits
from service.grading.trial_runner import TrialRunner
from sim.floors import build_floor
from sim.recording import Pose
from sim.robot import get_robot
from sim.world import Noise
text = "from ev3dev2.sensor.lego import CompassSensor\\nprint(CompassSensor(INPUT_4).bearing)"
program = ProgramSpec(SourceFile("robot.py", text), "preloaded", ChildLimits(2, 128 << 20), 1000)
spec = TrialSpec(program=program, responder=None, collaborative=False, floor=build_floor("Empty_Map"),
                 robot=get_robot("Default_Robot"), pose=Pose(500, 500, 30), noise=Noise(), channel=Channel(),
                 seconds=5, seed=1, child_seed=1)
with TrialRunner() as runner:
    recording = runner.run(spec)
assert [line.text for line in recording.printed] == ["60"], recording.faults
""",
    "model family": """
from models.tasks import load_tasks
assert "square" in load_tasks()
""",
    "page, a route, a command": """
import os, tempfile
from pathlib import Path
from sqlalchemy import select
from service.command_line import load_command
from service.settings import Settings
from service.store.engine import now, open_store
from service.store.tables.installation import Audit
from service.store.tables.submissions import Batch
from service.store.tables.courses import Course
from service.web.app import make_app
home = Path(tempfile.mkdtemp()) / "home"
os.environ["ROBOMARK_HOME"] = str(home)
with open_store(Settings(home=home)) as store:
    with store.transaction() as session:
        session.add(Course(id=1, name="default", created_at=now(session)))
        session.flush()
        session.add(Batch(id="0123456789ab", course_id=1, name="week one", created_at=now(session)))
    load_command("batch", "rename").main(["0123456789ab", "week two"], standalone_mode=False)
    with store.reading() as session:
        assert session.get_one(Batch, "0123456789ab").name == "week two"
        assert session.scalars(select(Audit.action)).all() == ["rename"]
    app = make_app(Settings(home=home), store)
    path = "/courses/{course_id}/batches/{batch_id}"
    assert "put" in app.openapi()["paths"]["/api/v1" + path + "/name"]
    assert app.url_path_for("rename", course_id=1, batch_id="0123456789ab") == "/courses/1/batches/0123456789ab/rename"
""",
    "table and its migration": """
import tempfile
from alembic import command
from service.settings import Settings
from service.store.engine import open_engine, open_store
from service.store.migrate import build_alembic_config, apply_migrations
from service.store.tables import METADATA
assert "batch_note" in METADATA.tables
engine = open_engine(f"sqlite:///{tempfile.mkdtemp()}/new.db")
with engine.begin() as connection:
    apply_migrations(connection)
with engine.begin() as connection:
    command.check(build_alembic_config(connection))
""",
    "setting": """
import os
from service.settings import load_settings
os.environ["ROBOMARK_WEBHOOK_SECONDS"] = "2.5"
assert load_settings().webhook_seconds == 2.5
""",
}
#: The migration of the example and the one before it. The tree may have newer ones.
_NEXT, _NEWEST = "0018", "0017"


def test_each_thing_has_an_example() -> None:
    assert DIFFS.keys() == TRIED.keys()


#: What contributors add most. The others are long tests.
_QUICK = ("criterion", "output format", "setting", "table and its migration")


@pytest.mark.long
@pytest.mark.parametrize(
    "added", [pytest.param(name, marks=[pytest.mark.long] * (name not in _QUICK)) for name in sorted(TRIED)]
)
def test_an_example_can_be_added_so(added: str, tmp_path: Path) -> None:
    for room in ROOMS:
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__", "catalogue"))
    applied = subprocess.run(
        ["git", "apply", "--unidiff-zero", "-"],
        cwd=tmp_path,
        input=_renumbered(DIFFS[added]),
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


def _renumbered(diff: str) -> str:
    """Return the diff with its migration after the newest one in the tree."""
    newest = find_newest_revision()
    return diff.replace(_NEXT, f"{int(newest) + 1:04d}").replace(_NEWEST, newest)
