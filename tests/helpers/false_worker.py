"""A worker that grades correctly until a file appears. From then on its robot accelerates too quickly.

Run it as a program, like ``service.queue.worker``. The pool children import it again and do the same.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from threading import Thread

import sim.robot
from service.queue.worker import run_worker
from service.settings import load_settings

VARIABLE = "TEST_FALSE_ONCE_THERE"


def _become_false(path: Path) -> None:
    while not path.exists():
        time.sleep(0.05)
    sim.robot.ACCELERATION = 6000.0


# A spawned pool child loads the main module under another name. A test that imports this module is not affected.
if __name__ in ("__main__", "__mp_main__"):
    Thread(target=_become_false, args=(Path(os.environ[VARIABLE]),), daemon=True).start()

if __name__ == "__main__":
    raise SystemExit(run_worker(load_settings()))
