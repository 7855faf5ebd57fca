"""Hashes of 100 trials under four loads, and with processor features disabled.

Run it with ``python -m benchmarks loads``. It exits with 1 if a load changes a recording. For the processor features,
it prints which parts give the same recordings: the simulator, the kit, and a program's own numpy.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from types import MappingProxyType
from unittest.mock import patch

from rich.console import Console
from rich.table import Table

from benchmarks.harness.process_tree import find_descendants
from responders.sandbox import zygote
from responders.source_file import SourceFile
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.processes import build_arithmetic_environment, build_python_command
from sim.recording import Verdict
from submissions.assignment.reader import read_assignment
from submissions.submission import Submission

Hashes = dict[str, list[str]]
_TRIALS = 100
_JOBS_PER_CORE = 4
#: Seconds of each period of 0.1 s in which throttled processes may run.
_PERIOD, _RUNNING = 0.1, 0.025
_ASSIGNMENT = """
id = "load-{part}"
title = "Same recordings"
[world]
background = "Line_Following_Test"
{parts}
[[scenario]]
id = "line"
poses = [[141, 125, 90]]
trials = {trials}
light_noise = 20
motor_noise = 40
seconds = 3
[[criterion]]
id = "runs"
title = "Runs"
marks = 1
check = "displacement"
distance = [1, 1000]
"""
_NO_RESPONDER = '[parts]\nresponder = "none"'
_FOLLOWER = """\
from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent
from ev3dev2.sensor import INPUT_2, INPUT_3
from ev3dev2.sensor.lego import ColorSensor
tank = MoveTank(OUTPUT_B, OUTPUT_C)
left, right = ColorSensor(INPUT_2), ColorSensor(INPUT_3)
for turn in range(60):
    steering = 0.4 * (left.reflected_light_intensity_pc - right.reflected_light_intensity_pc)
    tank.on(SpeedPercent(10 + steering), SpeedPercent(10 - steering))
"""
_SENDER = _FOLLOWER + 'print("IMG_DATA")\nimport time\ntime.sleep(0.5)\n'
_KIT = """\
import json
import numpy as np
from PIL import Image
from nn_tools.sensor_data import array_from_image, sensor_image_focus

def responder(message):
    values = [int(value) for value in json.loads(message.removeprefix("IMG_DATA::"))["left"].split(",")]
    image = Image.fromarray(np.array(values, dtype=np.uint8).reshape(20, 20, 4)).convert("L")
    return repr(array_from_image(sensor_image_focus(image, resize=(28, 28)), (28, 28)).tolist())
"""
_NUMPY = """\
import math
import numpy as np

def responder(message):
    table = np.random.random((64, 64))
    values = [table.sum(), (table @ table).sum(), np.exp(table).sum(), np.sin(table).sum(), np.tanh(table).mean()]
    values += [np.linalg.norm(table), math.sin(values[0]), math.pow(values[1], 0.3), math.exp(values[4])]
    return repr([float(value) for value in values])
"""
#: The parts: program, responder, and number of trials, which are 100 together.
_PARTS: Mapping[str, tuple[str, str | None, int]] = MappingProxyType(
    {"simulator": (_FOLLOWER, None, 40), "kit": (_SENDER, _KIT, 30), "numpy": (_SENDER, _NUMPY, 30)}
)
#: Variables that hide features of the processor from the C library, numpy and OpenBLAS.
_PROCESSORS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "AVX-512 off": {
            "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ,-AVX512CD",
            "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
        },
        "FMA off": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4", "OPENBLAS_CORETYPE": "Sandybridge"},
        "AVX2 and FMA off": {
            "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4",
            "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
            "OPENBLAS_CORETYPE": "Sandybridge",
        },
    }
)


def main(arguments: list[str]) -> int:
    """Print both tables. Return 1 if a load changes a hash. With ``grade``, only print the hashes of one process."""
    if arguments[:1] == ["grade"]:
        print(json.dumps(_grade_parts(json.loads(arguments[1]))))
        return 0
    expected = _run_alone()
    loads = {"alone": _run_alone, "four per core": _run_many, "beside a hog on each core": _run_beside_hogs}
    results = {name: run() == expected for name, run in (loads | {"throttled to a quarter": _run_throttled}).items()}
    _print_table(("load", f"{_count_trials(expected)} hashes"), list(results.items()))
    rows: list[tuple[str, *tuple[bool, ...]]] = []
    for name, variables in _PROCESSORS.items():
        hashes = _finish(_start(variables))
        rows.append((name, *(hashes[part] == expected[part] for part in _PARTS)))
    _print_table(("processor", *_PARTS), rows)
    return int(not all(results.values()))


def _grade_parts(variables: Mapping[str, str]) -> Hashes:
    """Grade all parts in this process, with these variables in the students' processes, too."""
    environment = build_arithmetic_environment() | dict(variables)
    with patch.object(zygote, "build_arithmetic_environment", lambda: environment), TrialRunner() as runner:
        return {part: _grade_part(part, runner) for part in _PARTS}


def _grade_part(part: str, runner: TrialRunner) -> list[str]:
    program, responder, trials = _PARTS[part]
    parts = _NO_RESPONDER if responder is None else ""
    with tempfile.TemporaryDirectory() as folder:
        text = _ASSIGNMENT.format(part=part, parts=parts, trials=trials)
        (Path(folder) / "assignment.toml").write_text(text)
        assignment = read_assignment(Path(folder))
    source = None if responder is None else SourceFile("responder.py", responder)
    graded = grade(Submission("ada", SourceFile("robot.py", program), source), assignment, runner=runner)
    for trial in graded.trials:
        if trial.verdict is not Verdict.FINISHED:
            raise RuntimeError(f"a trial of {part} ends with {trial.verdict}")
    return [trial.recording.sha256 for trial in graded.trials]


def _start(variables: Mapping[str, str] = MappingProxyType({})) -> subprocess.Popen[str]:
    command = build_python_command("-W", "ignore", "-m", "benchmarks", "loads", "grade", json.dumps(dict(variables)))
    path = str(Path(__file__).parents[1])
    environment = {**os.environ, **variables, "PYTHONPATH": path}
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)


def _finish(process: subprocess.Popen[str]) -> Hashes:
    output, _ = process.communicate()
    if process.returncode:
        raise RuntimeError("a grading failed")
    hashes: Hashes = json.loads(output)
    return hashes


def _run_alone() -> Hashes:
    return _finish(_start())


def _run_many() -> Hashes:
    """Return the hashes of gradings at the same time, or none if they differ."""
    processes = [_start() for _ in range(_JOBS_PER_CORE * len(os.sched_getaffinity(0)))]
    first, *others = [_finish(process) for process in processes]
    return first if all(each == first for each in others) else {}


def _run_beside_hogs() -> Hashes:
    with ExitStack() as stack:
        for core in os.sched_getaffinity(0):
            code = f"import os; os.sched_setaffinity(0, [{core}])\nwhile True: pass"
            hog = stack.enter_context(subprocess.Popen(build_python_command("-c", code)))
            stack.callback(hog.kill)
        return _finish(_start())


def _run_throttled() -> Hashes:
    """Return the hashes of a grading whose processes are stopped for three quarters of the time."""
    process = _start()
    with ThreadPoolExecutor() as executor:
        hashes = executor.submit(_finish, process)
        while process.poll() is None:
            time.sleep(_RUNNING)
            stopped = [process.pid, *find_descendants(process.pid)]
            _send(stopped, signal.SIGSTOP)
            time.sleep(_PERIOD - _RUNNING)
            _send(stopped, signal.SIGCONT)
        return hashes.result()


def _send(pids: Iterable[int], number: signal.Signals) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


def _count_trials(hashes: Hashes) -> int:
    return sum(len(each) for each in hashes.values())


def _print_table(headings: Sequence[str], rows: Sequence[tuple[str, *tuple[bool, ...]]]) -> None:
    table = Table(*headings, box=None)
    for name, *are_same in rows:
        table.add_row(name, *("the same" if is_same else "different" for is_same in are_same))
    Console().print(table)
