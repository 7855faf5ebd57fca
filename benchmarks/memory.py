"""Memory of a worker and of the processes that it forks from, and its growth per trial.

Shared memory counts in proportion, which depends on other processes. So growth counts only private memory.
"""

from __future__ import annotations

import json
import subprocess
import sys

from benchmarks.measurement import MEGABYTES, Measurement

#: Caches, two megabytes in total, are full after somewhat more than a thousand trials.
_WARM, _TRIALS = 1500, 1000
#: Grades short submissions. Prints the total megabytes at the end, and the private ones before and after the trials.
_WORKER = """
import gc, json, os, sys
from pathlib import Path
from benchmarks.graded_store import build_short_request
from benchmarks.harness.process_tree import find_descendants
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner

def held(kind):
    gc.collect()
    total = 0
    for pid in (os.getpid(), *find_descendants(os.getpid())):
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        total += next(int(line.split()[1]) for line in lines if line.startswith(kind))
    return total / 1024

def graded(count, first):
    done = 0
    while done < count:
        asked = build_short_request(f"student {first + done}")
        done += len(grade(asked.submission, asked.assignment, runner=runner).trials)

with TrialRunner() as runner:
    graded(int(sys.argv[1]), 0)
    before = held("Private_Dirty:")
    graded(int(sys.argv[2]), 10_000)
    print(json.dumps([held("Pss:"), before, held("Private_Dirty:")]))
"""


def measure(_times: int) -> list[Measurement]:
    """Measure the memory, in about a minute."""
    command = [sys.executable, "-c", _WORKER, str(_WARM), str(_TRIALS)]
    try:
        total, initial, final = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"the worker ends with {error.returncode}: {error.stderr}") from None
    return [
        Measurement("memory of a worker and of what it forks from", total, MEGABYTES, 400),
        Measurement(
            f"its growth in {_TRIALS} trials",
            final - initial,
            MEGABYTES,
            1,
            details=f"from {initial:.1f} MB of its own",
        ),
    ]
