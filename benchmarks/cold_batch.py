"""Ten short submissions with reports, from nothing: services started, graded, drawn, written, ended.

nbgrader's time for ten trivial notebooks was taken beside it once (docs/performance.md); it is not installed here.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from benchmarks.calibration import loop_seconds
from benchmarks.commands import ROBOMARK
from benchmarks.measurement import RATIO, Measurement, median_of, wall_seconds
from submissions.assignment.examples import REFERENCE, examples

_ASSIGNMENT = "echo-responder"
_SUBMISSIONS = 10
#: Wall seconds of `nbgrader autograde` on ten notebooks, for each second of the loop.
NBGRADER = 16.5 / 1.2


def measure(times: int) -> list[Measurement]:
    """The wall time, against that of nbgrader on a machine on which the loop is as fast."""
    loop = loop_seconds(times)
    seconds = median_of(min(times, 3), _cold)
    return [
        Measurement(
            "ten short submissions, cold batch with reports, wall against nbgrader's ten notebooks",
            seconds / loop / NBGRADER,
            RATIO,
            1 / 3,
            1 / 6,
            told=f"{seconds:.1f} s",
        )
    ]


def _cold() -> float:
    with tempfile.TemporaryDirectory() as folder:
        home, batch, reports = (Path(folder) / name for name in ("home", "batch", "reports"))
        for number in range(_SUBMISSIONS):
            own = batch / f"student{number}"
            shutil.copytree(examples(_ASSIGNMENT) / REFERENCE, own)
            # A text of its own, or it would be a copy of the one before, which is not run again.
            (own / "robot.py").write_text(f"# {number}\n" + (own / "robot.py").read_text())
        command = [*ROBOMARK, "batch", "submit", str(batch), "-a", _ASSIGNMENT, "--output", str(reports)]
        environment = os.environ | {"ROBOMARK_HOME": str(home)}
        return wall_seconds(lambda: subprocess.run(command, env=environment, check=True, capture_output=True))
