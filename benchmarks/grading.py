"""CPU costs of `robomark grade` for one short submission without third-party imports, and of its report."""

from __future__ import annotations

import tempfile

from benchmarks.calibration import measure_loop
from benchmarks.commands import ROBOMARK
from benchmarks.measurement import RATIO, Measurement, measure_command_cpu, median
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import REFERENCE

_ASSIGNMENT = "echo-responder"
#: One second on a machine where the loop takes 0.6.
_BUDGET, _BEYOND = 1.0 / 0.6, 0.6 / 0.6


def measure(times: int) -> list[Measurement]:
    """Measure all processes of the command together, relative to the calibration loop."""
    submission = str(locate_examples(_ASSIGNMENT) / REFERENCE)
    loop = measure_loop(times)
    with tempfile.TemporaryDirectory() as home:
        command = (*ROBOMARK, "grade", submission, "-a", _ASSIGNMENT)
        # The first run compiles bytecode.
        measure_command_cpu(command, {"ROBOMARK_HOME": home})
        seconds = median([measure_command_cpu(command, {"ROBOMARK_HOME": home}) for _ in range(times)])
    return [
        Measurement(
            "robomark grade, one short submission, standard library only, CPU against the loop",
            seconds / loop,
            RATIO,
            _BUDGET,
            _BEYOND,
            details=f"{seconds:.2f} s",
        )
    ]
