"""Child processes of a service: started so that they end with it, stopped in two steps, with small logs.

Independent of broker and worker. Also checks the file types in the run folder.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import stat
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from sim.errors import HostError
from sim.processes import launch_process

_LOG_BYTES = 10_000_000
_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


def start_process(
    command: Sequence[str],
    extra: Mapping[str, str],
    log: Path,
    end_signal: signal.Signals,
    descriptors: Sequence[int] = (),
) -> subprocess.Popen[bytes]:
    """Start a child in a new session that gets the signal ``end_signal`` when this thread ends for any reason.

    The child gets the variables ``extra`` in a clean environment and inherits only the descriptors ``descriptors``.
    Raises HostError if it cannot be started.
    """
    try:
        truncate_log(prepare_run_file(log))
        with log.open("ab") as output:
            return launch_process(
                command,
                extra,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                umask=0o077,
                pass_fds=tuple(descriptors),
                preexec_fn=_end_with_parent(os.getpid(), end_signal),
            )
    except OSError as error:
        raise HostError(f"{log} cannot be written, or {command[0]} not started: {error.strerror}") from None


def end_processes(processes: Sequence[subprocess.Popen[bytes]], grace_seconds: float) -> None:
    """Terminate all processes, kill those that do not end in time, and wait for all."""
    for process in processes:
        process.terminate()
    deadline = time.monotonic() + grace_seconds
    for process in processes:
        try:
            process.wait(timeout=max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.kill()
    for process in processes:
        process.wait()


def truncate_log(log: Path) -> None:
    """Truncate a log that is too long and keep a copy of it; the writing process is not affected."""
    if log.exists() and log.stat().st_size > _LOG_BYTES:
        shutil.copyfile(log, log.with_suffix(".log.1"))
        os.truncate(log, 0)


def prepare_run_file(path: Path, kind: Callable[[int], bool] = stat.S_ISREG) -> Path:
    """Return a path in the run folder after removing anything there that is not a file of this ``kind``.

    Raises HostError if the folder is not usable.
    """
    try:
        if not path.parent.is_dir():
            path.parent.unlink(missing_ok=True)
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not os.path.lexists(path) or kind(path.lstat().st_mode):
            return path
        if stat.S_ISDIR(path.lstat().st_mode):
            shutil.rmtree(path)
        else:
            path.unlink()
    except OSError as error:
        raise HostError(f"{error.filename or path} cannot be used: {error.strerror}") from None
    return path


def _end_with_parent(parent: int, number: signal.Signals) -> Callable[[], None]:
    def prepare() -> None:
        _libc.prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)

    return prepare
