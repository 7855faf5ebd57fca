"""A worker that grades rightly until a file appears, and from then on with a robot that speeds up too quickly.

Run as a program, like ``service.queue.worker``; the pool children import it again and do the same.
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


# A spawned pool child has the main module again under another name; a test that imports this one stays true.
if __name__ in ("__main__", "__mp_main__"):
    Thread(target=_become_false, args=(Path(os.environ[VARIABLE]),), daemon=True).start()

if __name__ == "__main__":
    raise SystemExit(run_worker(load_settings()))
