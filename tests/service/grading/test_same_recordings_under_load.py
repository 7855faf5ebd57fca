"""The load of the machine and the instructions of its processor change no recording, and so no mark."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

import pytest

from sim.processes import build_python_command

pytestmark = pytest.mark.long

_GRADINGS = textwrap.dedent("""
    import json, sys
    from service.grading.grader import grade
    from service.grading.trial_runner import TrialRunner
    from submissions.assignment.examples import locate_examples
    from submissions.assignment.reader import find_assignment
    from submissions.bundle import read_submission

    recordings = {}
    with TrialRunner() as runner:
        for name in ("two-sensor-line-follower", "shape-recognition", "stop-at-black-line"):
            assignment = find_assignment(name)
            submission = read_submission(locate_examples(name) / "reference", required_parts=assignment.parts)
            result = grade(submission, assignment, runner=runner)
            recordings[name] = [str(result.marks), *(trial.recording.sha256 for trial in result.trials)]
    print(json.dumps(recordings))
""")
_CORES = sorted(os.sched_getaffinity(0))
NO_CHANGES: Mapping[str, str] = MappingProxyType({})
#: Other instructions for the simulator: of the C library's functions, of numpy, and of OpenBLAS.
PROCESSORS = {
    "no FMA": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4"},
    "no AVX2": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"},
    "old kernels": {"OPENBLAS_CORETYPE": "Nehalem"},
}


def _start(variables: Mapping[str, str] = NO_CHANGES, *, cores: list[int] = _CORES) -> subprocess.Popen[str]:
    """Start the gradings in a process of their own on these cores."""
    return subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", _GRADINGS],
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )


def _finish(process: subprocess.Popen[str]) -> dict[str, list[str]]:
    output, _ = process.communicate()
    assert process.returncode == 0
    recordings: dict[str, list[str]] = json.loads(output)
    return recordings


@contextmanager
def _computing(cores: list[int]) -> Iterator[None]:
    """Compute without end beside the block, once for each item of ``cores``."""
    hogs = [
        subprocess.Popen(build_python_command("-c", f"import os; os.sched_setaffinity(0, [{core}])\nwhile True: pass"))
        for core in cores
    ]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


@pytest.fixture(scope="module")
def expected() -> dict[str, list[str]]:
    """Return marks and hashes of 15 trials that ran alone."""
    recordings = _finish(_start())
    assert [marks for marks, *_ in recordings.values()] == ["10.00", "12.00", "8.00"]
    return recordings


def test_four_gradings_on_one_core(expected: dict[str, list[str]]) -> None:
    """Each of them has a quarter of it."""
    processes = [_start(cores=_CORES[:1]) for _ in range(4)]
    assert [_finish(process) for process in processes] == [expected] * 4


def test_beside_a_process_that_computes_on_each_core(expected: dict[str, list[str]]) -> None:
    with _computing(_CORES):
        assert _finish(_start()) == expected


@pytest.mark.parametrize("processor", PROCESSORS)
def test_with_other_instructions(processor: str, expected: dict[str, list[str]]) -> None:
    assert _finish(_start(PROCESSORS[processor])) == expected
