"""A process with the heavy imports loaded that forks one child a spec; it never holds anything secret.

It is exec'd with a clean environment, has one thread, and dies with its worker.
"""

from __future__ import annotations

import array
import contextlib
import ctypes
import functools
import gc
import importlib
import json
import os
import signal
import socket
import sys
from typing import Any

_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4
_ENDED = (ctypes.c_char * 152)()  # the status and, from the eighth byte, what was used; zeroes but for a moment


#: All that student code finds: libraries loaded late must not start threads either.
_ENVIRONMENT = {
    "HOME": "/",
    "LANG": "C.UTF-8",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "ORT_DISABLE_TELEMETRY": "1",
}


def main(role_name: str, folders: str, without: list[str], roots: list[str]) -> None:
    """Serve specs on descriptor 3 until the worker closes it.

    ``folders`` is where children have theirs, ``without`` are modules that none of them may have.
    """
    _before_the_worker()
    prctl = ctypes.CDLL(None).prctl
    prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.dont_write_bytecode = True
    sys.path[:0] = roots
    from . import battery, child, determinism, doorkeeper, grants, libraries, lockdown, refusals, withheld  # noqa: F401

    control = socket.socket(fileno=3)
    if role_name == "robot":
        from . import robot_role as role
    elif role_name == "robot with libraries":
        from . import robot_with_libraries as role  # type: ignore[no-redef]
    elif role_name == "responder":
        from . import responder_zygote as role  # type: ignore[no-redef]
    else:
        from . import responder_with_libraries as role  # type: ignore[no-redef]
    for name in role.NEEDED:
        importlib.import_module(name)
    closed = withheld.keep_out(tuple(without))
    readable = grants.readable(roots, closed)
    allowed = lockdown.Grants(readable, grants.listable(roots, closed), open_to_others=grants.open_to_others(readable))
    door = doorkeeper.start(allowed, control.fileno())
    role.preload(without)
    prepared = child.Prepared(
        allowed, lockdown.reading_rules(allowed), child.changed_signals(), os.getpid(), door.fileno()
    )
    with_libraries = role_name.endswith("with libraries")
    run = role.run if with_libraries else functools.partial(libraries.run_without, role.run)
    roles = {"role": run, "battery": battery.run}
    os.environ.clear()
    os.environ.update(_ENVIRONMENT)
    _one_thread()
    gc.collect()
    gc.freeze()
    inside = os.open(folders, os.O_RDONLY | os.O_DIRECTORY)
    _reply(control, {"ready": True}, [inside])
    os.close(inside)
    while True:
        spec, descriptors = _receive(control)
        if spec is None:
            os._exit(0)
        if spec["do"] == "spawn":
            os.sched_setaffinity(0, spec["processors"])
            pid = os.fork()
            if pid == 0:
                child.start(spec, descriptors, roles[spec["work"]], prepared)
            _hand_over(control, pid)
            for fd in descriptors:
                os.close(fd)
        else:
            _reap(control, spec["pid"])


def _hand_over(control: socket.socket, pid: int) -> None:
    """Give the worker what it can end the child with."""
    try:
        pidfd = os.pidfd_open(pid)
    except OSError as error:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        _reply(control, {"missing": f"pidfd_open: {error.strerror}"})
        return
    _reply(control, {"pid": pid}, [pidfd])
    os.close(pidfd)


def _reap(control: socket.socket, pid: int) -> None:
    """Hand on how a child ended without looking: what this process has held once, the next child finds in its copy."""
    if ctypes.CDLL(None).wait4(pid, ctypes.byref(_ENDED), 0, ctypes.byref(_ENDED, 8)) != pid:
        raise ChildProcessError(f"no child {pid}")
    control.send(_ENDED)
    ctypes.memset(_ENDED, 0, ctypes.sizeof(_ENDED))


def _before_the_worker() -> None:
    """When the machine runs out of memory, children go first, then their zygote, and only then the worker."""
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as score:
        score.write("700")


def _one_thread() -> None:
    with open("/proc/self/status") as status:
        threads = next(int(line.split()[1]) for line in status if line.startswith("Threads:"))
    if threads != 1:
        raise SystemExit(f"the zygote has {threads} threads; it can fork safely only with one")


def _receive(control: socket.socket) -> tuple[dict[str, Any] | None, list[int]]:
    data, ancillary, _, _ = control.recvmsg(65536, socket.CMSG_SPACE(8 * 4))
    descriptors = array.array("i")
    for _, _, payload in ancillary:
        descriptors.frombytes(payload[: len(payload) - len(payload) % 4])
    return (json.loads(data) if data else None), list(descriptors)


def _reply(control: socket.socket, answer: dict[str, Any], descriptors: list[int] | None = None) -> None:
    payload = array.array("i", descriptors or [])
    ancillary = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)] if descriptors else []
    control.sendmsg([json.dumps(answer).encode()], ancillary)
