"""A worker that grades correctly until a file appears. From then on its robot accelerates too quickly.

Its self-tests then tell nothing until a second file appears, so that a test decides how many grades are wrong by then.
Run it as a program, like ``service.queue.worker``. The pool children import it again and do the same.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from threading import Thread

import sim.robot
from service.grading.trial_runner import TrialRunner
from service.queue import self_test
from service.queue.worker import run_worker
from service.settings import load_settings

VARIABLE = "TEST_FALSE_SWITCHES"
#: Files in the folder that the variable names: the two switches, and one that each false process leaves.
BECOME_FALSE, FIND_OUT, IS_FALSE = "become-false", "find-out", "is-false-{pid}"
_run_self_test = self_test.run_self_test


def _become_false(folder: Path) -> None:
    while not (folder / BECOME_FALSE).exists():
        time.sleep(0.05)
    sim.robot.ACCELERATION = 6000.0
    (folder / IS_FALSE.format(pid=os.getpid())).touch()


def _run_self_test_if_wanted(runner: TrialRunner) -> self_test.KnownAnswer | None:
    folder = Path(os.environ[VARIABLE])
    # The answer is discarded afterwards: the robot can become false during the test.
    answer = _run_self_test(runner)
    is_early = (folder / BECOME_FALSE).exists() and not (folder / FIND_OUT).exists()
    return None if is_early else answer


# A spawned pool child loads the main module under another name. A test that imports this module is not affected.
if __name__ in ("__main__", "__mp_main__"):
    self_test.run_self_test = _run_self_test_if_wanted
    Thread(target=_become_false, args=(Path(os.environ[VARIABLE]),), daemon=True).start()

if __name__ == "__main__":
    raise SystemExit(run_worker(load_settings()))
