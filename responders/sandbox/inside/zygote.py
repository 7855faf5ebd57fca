"""A process with loaded imports that forks one child per spec. It never holds secrets.

It is executed with a clean environment, has one thread, and ends with its worker.
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
from collections.abc import Callable, Mapping
from typing import Any

from . import child, grants, lockdown
from .frames import Wire

_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4
_EXIT_REPORT = (ctypes.c_char * 152)()  # the status and, from byte 8, the resource usage; zero except briefly
_STATUS, _USED = ctypes.byref(_EXIT_REPORT), ctypes.byref(_EXIT_REPORT, 8)
_ANY_CHILD = b"\xff" * 4  # -1 for wait4(2)
_PRACTICE_FORKS = 2
_wait4 = ctypes.CDLL(None).wait4
#: Environment variables for student code, in addition to a home. Libraries that are loaded late must not start threads
#: or use other kernels either.
_KEPT_VARIABLES = (
    "LANG",
    "NPY_DISABLE_CPU_FEATURES",
    "OMP_NUM_THREADS",
    "OPENBLAS_CORETYPE",
    "OPENBLAS_NUM_THREADS",
    "ORT_DISABLE_TELEMETRY",
)


def main(role_name: str, folders: str, exclusions: list[str], roots: list[str]) -> None:
    """Fork children as ordered on descriptor 3 until the worker closes it. Specs arrive on descriptor 4.

    The worker may close descriptor 3 before it reads a reply.

    Args:
        role_name: The role of the children.
        folders: The parent of private folders.
        exclusions: Modules that no child may have.
        roots: Folders for imports.
    """
    try:
        _run_zygote(role_name, folders, exclusions, roots)
    except ConnectionError:
        os._exit(0)


def _run_zygote(role_name: str, folders: str, exclusions: list[str], roots: list[str]) -> None:
    _raise_oom_score()
    prctl = ctypes.CDLL(None).prctl
    prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.dont_write_bytecode = True
    sys.path[:0] = roots
    from . import battery, determinism, doorkeeper, excluded_modules, libraries, refusals  # noqa: F401

    control, specs = socket.socket(fileno=3), socket.socket(fileno=4)
    if role_name == "robot":
        from . import robot_role as role
    elif role_name == "robot with libraries":
        from . import robot_with_libraries as role  # type: ignore[no-redef]
    elif role_name == "responder":
        from . import responder_zygote as role  # type: ignore[no-redef]
    else:
        from . import responder_with_libraries as role  # type: ignore[no-redef]
    determinism.install_randomness(0)  # libraries draw random numbers while loading, which affects addresses
    for name in role.NEEDED:
        importlib.import_module(name)
    closed_paths = excluded_modules.exclude_modules(tuple(exclusions))
    readable = grants.list_readable_paths(roots, closed_paths)
    permissions = lockdown.Grants(
        readable, grants.list_listable_folders(roots, closed_paths), open_to_others=grants.is_open_to_others(readable)
    )
    door = doorkeeper.start_doorkeeper(permissions, (control.fileno(), specs.fileno()))
    role.preload(exclusions)
    setup = child.ChildSetup(
        permissions, lockdown.build_reading_rules(permissions), child.list_changed_signals(), os.getpid(), door.fileno()
    )
    has_libraries = role_name.endswith("with libraries")
    run = role.run if has_libraries else functools.partial(libraries.run_without_libraries, role.run)
    roles = {"role": run, "battery": battery.run}
    kept_variables = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
    os.environ.clear()
    os.environ.update(kept_variables, HOME="/")
    _check_single_thread()
    gc.collect()
    gc.disable()
    gc.freeze()
    folders_descriptor = os.open(folders, os.O_RDONLY | os.O_DIRECTORY)
    _send_reply(control, {"ready": True}, [folders_descriptor])
    os.close(folders_descriptor)
    _practise_forks()
    _serve_orders(control, functools.partial(_become_child, specs, roles, setup))
    os._exit(0)


def _serve_orders(control: socket.socket, become_child: Callable[[], object]) -> None:
    """Fork a child for each order of 0. For any other order, wait for the end of the child with that id.

    A child reads its own spec. This process keeps no new objects meanwhile, so the initial memory and addresses of
    children don't depend on earlier forks.
    """
    order = bytearray(4)
    while control.recv_into(order):
        if any(order):
            _reap(control, int.from_bytes(order, "little"))
        elif os.fork() == 0:
            become_child()


def _practise_forks() -> None:
    """Fork children that end at once, so that effects of first calls on memory occur before any other child."""
    receiver, sender = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for _ in range(_PRACTICE_FORKS):
        sender.send(bytes(4))
        sender.send(_ANY_CHILD)
    sender.shutdown(socket.SHUT_WR)
    _serve_orders(receiver, functools.partial(os._exit, 0))
    receiver.close()
    sender.close()


def _become_child(
    specs: socket.socket, roles: Mapping[str, Callable[[Wire, lockdown.Grants], None]], setup: child.ChildSetup
) -> None:
    """Run a child in this process; never returns."""
    try:
        spec, descriptors = _receive_spec(specs)
        pidfd = os.pidfd_open(os.getpid())
    except OSError as error:
        _send_reply(specs, {"missing": f"pidfd_open: {error.strerror}"})
        os._exit(0)
    _send_reply(specs, {"pid": os.getpid()}, [pidfd])
    child.run_child(spec, descriptors, roles[spec["work"]], setup)


def _reap(control: socket.socket, pid: int) -> None:
    """Report the end of a child without decoding it: any object kept here would be in the next child's memory."""
    if _wait4(pid, _STATUS, 0, _USED) < 0:
        raise ChildProcessError(f"no child {pid}")
    control.send(_EXIT_REPORT)
    ctypes.memset(_EXIT_REPORT, 0, ctypes.sizeof(_EXIT_REPORT))


def _raise_oom_score() -> None:
    """Make the kernel kill children first when memory runs out, then the zygote, and the worker last."""
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as score:
        score.write("700")


def _check_single_thread() -> None:
    with open("/proc/self/status") as status:
        threads = next(int(line.split()[1]) for line in status if line.startswith("Threads:"))
    if threads != 1:
        raise SystemExit(f"the zygote has {threads} threads; it can fork safely only with one")


def _receive_spec(specs: socket.socket) -> tuple[dict[str, Any], list[int]]:
    data, ancillary, _, _ = specs.recvmsg(65536, socket.CMSG_SPACE(8 * 4))
    descriptors = array.array("i")
    for _, _, payload in ancillary:
        descriptors.frombytes(payload[: len(payload) - len(payload) % 4])
    return json.loads(data), list(descriptors)


def _send_reply(control: socket.socket, answer: dict[str, Any], descriptors: list[int] | None = None) -> None:
    payload = array.array("i", descriptors or [])
    ancillary = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, payload)] if descriptors else []
    control.sendmsg([json.dumps(answer).encode()], ancillary)
