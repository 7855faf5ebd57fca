"""Processes that are started again when they end: a worker, and whatever else a service consists of.

Runs no loop of its own; whoever supervises calls ``ensure`` again and again.
"""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from service.queue.alive import WORKER_VARIABLE, alive_path, new_worker_name
from service.queue.broker import broker_version
from service.queue.processes import end_processes, keep_small, start_process
from service.settings import Settings
from service.store.engine import Store
from service.store.queue import jobs, workers
from sim.processes import python_command

#: Imports throw nothing away, and to look for garbage is a tenth of what they cost.
_WORKER = "import gc; gc.disable(); from service.queue.worker import main; main()"
#: One that ends sooner than this after its start is started again only after a wait, which doubles.
_SHORT_LIFE_SECONDS = 10.0
_LONGEST_WAIT_SECONDS = 60.0
#: A worker that has taken no message and not even looked for so long is ended; its start alone can take a while.
_SILENT_SECONDS = 120.0
_LONGEST_LOOK_SECONDS = 2.0
_PING_SECONDS = 2.0


class SupervisedProcess:
    """One process: started when it does not run, at once or, after short lives, after longer and longer waits."""

    def __init__(self, command: Sequence[str], environment: dict[str, str], log: Path, kept_open: Sequence[int] = ()):
        self._command = command
        self._environment = environment
        self._log = log
        self._kept_open = kept_open
        self._process: subprocess.Popen[bytes] | None = None
        self._begun = 0.0
        self._not_before = 0.0
        self.short_lives = 0  # one after another

    @property
    def pid(self) -> int | None:
        """Its process id, if it was started and not yet seen to end."""
        return None if self._process is None else self._process.pid

    @property
    def log(self) -> Path:
        """Where its output goes."""
        return self._log

    def ended(self) -> bool:
        """Whether it has ended since it was last started. True once for each end."""
        if self._process is None or self._process.poll() is None:
            return False
        self._process = None
        short = time.monotonic() - self._begun < _SHORT_LIFE_SECONDS
        self.short_lives = self.short_lives + 1 if short else 0
        wait = min(2.0 ** (self.short_lives - 1), _LONGEST_WAIT_SECONDS) if short else 0.0
        self._not_before = time.monotonic() + wait
        return True

    def start(self, extra: dict[str, str]) -> bool:
        """Start it with these variables more, unless it runs or its wait is not over. Whether it was started."""
        if self._process is not None or time.monotonic() < self._not_before:
            return False
        self._begun = time.monotonic()
        self._process = start_process(
            self._command, self._environment | extra, self._log, signal.SIGKILL, self._kept_open
        )
        return True

    def kill(self) -> None:
        """Make it end now."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def stop(self, grace_seconds: float) -> None:
        """End it for good."""
        stop_all([self], grace_seconds)

    def keep_log_small(self) -> None:
        """Begin the log afresh when it has grown too long."""
        keep_small(self._log)


def stop_all(supervised: Sequence[SupervisedProcess], grace_seconds: float) -> None:
    """End them for good, side by side."""
    end_processes([each._process for each in supervised if each._process is not None], grace_seconds)
    for each in supervised:
        each._process = None


class SupervisedWorker:
    """One worker process; when it ends, or no longer takes messages, what it held goes back and another is started."""

    def __init__(self, settings: Settings, store: Store, log: Path) -> None:
        self._settings = settings
        self._store = store
        self.process = SupervisedProcess(python_command("-c", _WORKER), settings.environment(), log)
        self._name = ""
        self._seen = 0
        self._looked = 0.0
        self._silent = 0.0

    @property
    def takes_messages(self) -> bool:
        """Whether it has begun to look for work."""
        try:
            return alive_path(self._settings, self._name).stat().st_size > 0
        except OSError:
            return False

    def ensure(self) -> None:
        """Start it if it does not run and its wait is over."""
        if self.process.pid is not None and self._is_silent():
            self.process.kill()
        if self.process.ended():
            self.forget()
        if self.process.pid is None:
            self._start()

    def forget(self) -> int:
        """Give back what it held, now that it has ended and nobody can fence us. Returns how many jobs that were."""
        if not self._name:
            return 0
        given_back = jobs.release_worker(self._store, self._name)
        workers.forget(self._store, self._name)
        alive_path(self._settings, self._name).unlink(missing_ok=True)
        self._name = ""
        return given_back

    def stop(self, grace_seconds: float) -> int:
        """End it for good; returns how many jobs in flight went back."""
        self.process.stop(grace_seconds)
        return self.forget()

    def _start(self) -> None:
        # One whose end could not be written down in the database is not forgotten.
        self.forget()
        name = new_worker_name()
        if self.process.start({WORKER_VARIABLE: name}):
            self._name, self._seen, self._silent, self._looked = name, 0, 0.0, time.monotonic()

    def _is_silent(self) -> bool:
        """Whether it has not touched its file for long, though the broker answers. Only looks count, not clocks."""
        moment = time.monotonic()
        self._silent += min(moment - self._looked, _LONGEST_LOOK_SECONDS)
        self._looked = moment
        try:
            touched = alive_path(self._settings, self._name).stat().st_mtime_ns
        except OSError:
            touched = 0
        if touched != self._seen:
            self._seen, self._silent = touched, 0.0
        if self._silent < _SILENT_SECONDS:
            return False
        self._silent = 0.0
        return broker_version(self._settings.broker_url, _PING_SECONDS) is not None
