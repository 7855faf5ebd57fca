"""Child processes of a service: started so that they end with us, ended in two steps, their logs kept small.

Knows neither broker nor worker; also makes sure that what lies in the run folder is what it should be.
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
from sim.processes import start

_LOG_BYTES = 10_000_000
_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


def start_process(
    command: Sequence[str],
    extra: Mapping[str, str],
    log: Path,
    at_our_end: signal.Signals,
    kept_open: Sequence[int] = (),
) -> subprocess.Popen[bytes]:
    """A child in a session of its own that gets ``at_our_end`` when this thread ends, however it ends.

    It has the variables ``extra`` beside a clean environment, and inherits the descriptors ``kept_open`` and no other.
    Raises HostError when it cannot be started.
    """
    try:
        keep_small(run_file(log))
        with log.open("ab") as output:
            return start(
                command,
                extra,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                umask=0o077,
                pass_fds=tuple(kept_open),
                preexec_fn=_dies_with(os.getpid(), at_our_end),
            )
    except OSError as error:
        raise HostError(f"{log} cannot be written, or {command[0]} not started: {error.strerror}") from None


def end_processes(processes: Sequence[subprocess.Popen[bytes]], grace_seconds: float) -> None:
    """Ask them all to end, then make those that have not, and wait until all have."""
    for process in processes:
        process.terminate()
    until = time.monotonic() + grace_seconds
    for process in processes:
        try:
            process.wait(timeout=max(0.0, until - time.monotonic()))
        except subprocess.TimeoutExpired:
            process.kill()
    for process in processes:
        process.wait()


def keep_small(log: Path) -> None:
    """Begin a log afresh when it has grown too long, keeping the one before; whoever writes it need not know."""
    if log.exists() and log.stat().st_size > _LOG_BYTES:
        shutil.copyfile(log, log.with_suffix(".log.1"))
        os.truncate(log, 0)


def run_file(path: Path, kind: Callable[[int], bool] = stat.S_ISREG) -> Path:
    """A path in the run folder where a file of this ``kind`` is, or nothing; what else lies there is removed.

    Raises HostError when the folder cannot be used.
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


def _dies_with(parent: int, number: signal.Signals) -> Callable[[], None]:
    def prepare() -> None:
        _libc.prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)

    return prepare
