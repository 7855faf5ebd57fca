"""CPU costs of `robomark grade` for one short submission without third-party imports, and of its report."""

from __future__ import annotations

import tempfile

from benchmarks.calibration import loop_seconds
from benchmarks.commands import ROBOMARK
from benchmarks.measurement import RATIO, Measurement, command_cpu_seconds, median
from submissions.assignment.examples import examples
from submissions.assignment.folder import REFERENCE

_ASSIGNMENT = "echo-responder"
#: One second on a machine where the loop takes 0.6.
_BUDGET, _BEYOND = 1.0 / 0.6, 0.6 / 0.6


def measure(times: int) -> list[Measurement]:
    """Measure all processes of the command together, relative to the calibration loop."""
    submission = str(examples(_ASSIGNMENT) / REFERENCE)
    loop = loop_seconds(times)
    with tempfile.TemporaryDirectory() as home:
        command = (*ROBOMARK, "grade", submission, "-a", _ASSIGNMENT)
        # The first run compiles bytecode.
        command_cpu_seconds(command, {"ROBOMARK_HOME": home})
        seconds = median([command_cpu_seconds(command, {"ROBOMARK_HOME": home}) for _ in range(times)])
    return [
        Measurement(
            "robomark grade, one short submission, standard library only, CPU against the loop",
            seconds / loop,
            RATIO,
            _BUDGET,
            _BEYOND,
            told=f"{seconds:.2f} s",
        )
    ]
