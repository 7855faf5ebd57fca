"""Supervised processes, which are restarted when they end: workers and other parts of a service.

Contains no loop; the supervisor calls ``ensure`` repeatedly.
"""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from service.queue.broker import fetch_broker_version
from service.queue.live_workers import WORKER_VARIABLE, build_heartbeat_path, create_worker_name
from service.queue.processes import end_processes, start_process, truncate_log
from service.settings import Settings
from service.store.engine import Store
from service.store.queue import jobs, workers
from sim.processes import build_python_command

#: Imports create little garbage, and collecting it would take a tenth of their time.
_WORKER_CODE = "import gc; gc.disable(); from service.queue.worker import main; main()"
#: A process that ends sooner than this after its start is restarted only after a delay, which doubles.
_SHORT_LIFE_SECONDS = 10.0
_MAX_WAIT_SECONDS = 60.0
#: A worker without activity for this long is stopped; its start alone can take a while.
_MAX_SILENT_SECONDS = 120.0
_MAX_STEP_SECONDS = 2.0
_PING_SECONDS = 2.0


class SupervisedProcess:
    """A process that is started when it does not run, with increasing delays after short lives."""

    def __init__(self, command: Sequence[str], environment: dict[str, str], log: Path, descriptors: Sequence[int] = ()):
        self._command = command
        self._environment = environment
        self._log = log
        self._descriptors = descriptors
        self._process: subprocess.Popen[bytes] | None = None
        self._start_time = 0.0
        self._earliest_start = 0.0
        self.short_lives = 0  # consecutive

    @property
    def pid(self) -> int | None:
        """The process id; None if the process was not started or its end was detected."""
        return None if self._process is None else self._process.pid

    @property
    def log(self) -> Path:
        """The file with its output."""
        return self._log

    def detect_end(self) -> bool:
        """Return whether it has ended since its last start. True once for each end."""
        if self._process is None or self._process.poll() is None:
            return False
        self._process = None
        is_short = time.monotonic() - self._start_time < _SHORT_LIFE_SECONDS
        self.short_lives = self.short_lives + 1 if is_short else 0
        wait = min(2.0 ** (self.short_lives - 1), _MAX_WAIT_SECONDS) if is_short else 0.0
        self._earliest_start = time.monotonic() + wait
        return True

    def start(self, extra: dict[str, str]) -> bool:
        """Start it with these additional variables, unless it runs or its delay is not over.

        Return whether it started.
        """
        if self._process is not None or time.monotonic() < self._earliest_start:
            return False
        self._start_time = time.monotonic()
        self._process = start_process(
            self._command, self._environment | extra, self._log, signal.SIGKILL, self._descriptors
        )
        return True

    def kill(self) -> None:
        """Kill it and wait for its end."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def stop(self, grace_seconds: float) -> None:
        """Stop it permanently."""
        stop_processes([self], grace_seconds)

    def truncate_log_file(self) -> None:
        """Truncate the log if it is too long."""
        truncate_log(self._log)


def stop_processes(processes: Sequence[SupervisedProcess], grace_seconds: float) -> None:
    """Stop processes permanently, in parallel."""
    end_processes([each._process for each in processes if each._process is not None], grace_seconds)
    for process in processes:
        process._process = None


class SupervisedWorker:
    """A worker process. If it ends or becomes unresponsive, its jobs are requeued and a new one is started."""

    def __init__(self, settings: Settings, store: Store, log: Path) -> None:
        self._settings = settings
        self._store = store
        self.process = SupervisedProcess(build_python_command("-c", _WORKER_CODE), settings.to_environment(), log)
        self._name = ""
        self._heartbeat_time = 0
        self._last_check = 0.0
        self._silent_seconds = 0.0

    @property
    def takes_messages(self) -> bool:
        """Return whether it has started to look for jobs."""
        try:
            return build_heartbeat_path(self._settings, self._name).stat().st_size > 0
        except OSError:
            return False

    def ensure(self) -> None:
        """Start it if it does not run and its delay is over."""
        if self.process.pid is not None and self._is_silent():
            self.process.kill()
        if self.process.detect_end():
            self.release_jobs()
        if self.process.pid is None:
            self._start()

    def release_jobs(self) -> int:
        """Requeue the jobs of the ended worker, which cannot finish them any more. Returns their number."""
        if not self._name:
            return 0
        job_count = jobs.release_worker(self._store, self._name)
        workers.delete_heartbeat(self._store, self._name)
        build_heartbeat_path(self._settings, self._name).unlink(missing_ok=True)
        self._name = ""
        return job_count

    def stop(self, grace_seconds: float) -> int:
        """Stop it permanently. Returns the number of requeued jobs."""
        self.process.stop(grace_seconds)
        return self.release_jobs()

    def _start(self) -> None:
        # Handles an earlier worker whose end could not be stored in the database.
        self.release_jobs()
        name = create_worker_name()
        if self.process.start({WORKER_VARIABLE: name}):
            self._name, self._heartbeat_time, self._silent_seconds, self._last_check = name, 0, 0.0, time.monotonic()

    def _is_silent(self) -> bool:
        """Return whether the worker has not touched its heartbeat file for too long although the broker responds.

        Counts only observed time, so changes of the clock have no effect.
        """
        moment = time.monotonic()
        self._silent_seconds += min(moment - self._last_check, _MAX_STEP_SECONDS)
        self._last_check = moment
        try:
            heartbeat_time = build_heartbeat_path(self._settings, self._name).stat().st_mtime_ns
        except OSError:
            heartbeat_time = 0
        if heartbeat_time != self._heartbeat_time:
            self._heartbeat_time, self._silent_seconds = heartbeat_time, 0.0
        if self._silent_seconds < _MAX_SILENT_SECONDS:
            return False
        self._silent_seconds = 0.0
        return fetch_broker_version(self._settings.broker_url, _PING_SECONDS) is not None
