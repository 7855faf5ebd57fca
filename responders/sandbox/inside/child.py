"""From fork to student code: the layers go up in order, and nothing of the zygote's is left within reach.

The role (robot program or responder) takes over once every layer stands.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import os
import resource
import signal
import socket
from collections.abc import Callable
from typing import Any

from . import doorkeeper, lockdown
from .frames import Frame, Wire

_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4

_WIRE, _DOOR = 3, 4
#: Where the numbers of users begin that exist for one child each; nothing on a machine should belong to them.
_USERS, _USERS_COUNT = 61_000, 4_000
#: All that student code finds: libraries loaded late must not start threads either.
_ENVIRONMENT = {
    "HOME": "/",
    "LANG": "C.UTF-8",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "ORT_DISABLE_TELEMETRY": "1",
}


def start(
    spec: dict[str, Any],
    descriptors: list[int],
    grants: lockdown.Grants,
    role: Callable[[Wire, lockdown.Grants], None],
    zygote: int,
    door: int,
) -> None:
    """Never returns. ``descriptors`` are the wire and, if the spec has a folder, the folder."""
    try:
        _own_session()
        _first_to_go()
        _descriptors([descriptors[0], door, *descriptors[1:]])
        _limits(spec)
        wire = Wire(_WIRE)
        wire.send(_sandbox(spec, grants, zygote))
        os.environ.clear()
        os.environ.update(_ENVIRONMENT)
        role(wire, dataclasses.replace(grants, without=tuple(spec["without"])))
    finally:
        os._exit(0)


def _own_session() -> None:
    os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def _first_to_go() -> None:
    """When the machine runs out of memory, a child goes before its zygote.

    Files of a process that is not to be read, as the zygote, are root's; so this one is to be, until it is locked.
    """
    ctypes.CDLL(None).prctl(_PR_SET_DUMPABLE, 1, 0, 0, 0)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w") as score:
        score.write("1000")


def _own_user(spec: dict[str, Any], grants: lockdown.Grants) -> bool:
    """Root makes each child somebody who owns nothing, where the interpreter can be read by such a user."""
    if not grants.open_to_others or not lockdown.may_change_user():
        return False
    user = _USERS + os.getpid() % _USERS_COUNT
    if spec["folder"]:
        for name in [".", *os.listdir()]:
            os.chown(name, user, user, follow_symlinks=False)
    lockdown.become(user)
    return True


def _end_with(zygote: int) -> None:
    """A change of user forgets both of these, so they come after it."""
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0)
    if os.getppid() != zygote:
        os._exit(0)


def _descriptors(descriptors: list[int]) -> None:
    """Nothing stays open but the null device on 0 to 2, the wire and the door; a folder becomes the working folder."""
    high = [os.dup2(fd, 100 + place) for place, fd in enumerate(descriptors)]
    null = os.open(os.devnull, os.O_RDWR)
    for fd in (0, 1, 2):
        os.dup2(null, fd)
    os.dup2(high[0], _WIRE)
    os.dup2(high[1], _DOOR)
    os.chdir(high[2] if len(high) > 2 else "/")
    os.closerange(_DOOR + 1, 1 << 16)
    os.umask(0o077)


def _limits(spec: dict[str, Any]) -> None:
    """Address space beyond what the zygote maps already, CPU as a backstop, small files, few descriptors."""
    with open("/proc/self/statm", "rb") as statm:
        mapped = int(statm.read().split()[0]) * resource.getpagesize()
    memory = mapped + spec["memory"]
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    seconds = int(spec["cpu"]) + 2
    # The worker is there long before the second limit: a SIGKILL that it did not send is never this one's.
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 60))
    resource.setrlimit(resource.RLIMIT_FSIZE, (spec["file_size"], spec["file_size"]))
    resource.setrlimit(resource.RLIMIT_NOFILE, (32, 32))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
    resource.setrlimit(resource.RLIMIT_MSGQUEUE, (0, 0))
    resource.setrlimit(resource.RLIMIT_SIGPENDING, (0, 0))


def _sandbox(spec: dict[str, Any], grants: lockdown.Grants, zygote: int) -> Frame:
    """Put up the layers that the spec names, try each, and say what stands; nothing of the student's has run yet."""
    missing = None
    landlock, seccomp, own_user = 0, False, False
    without_doorkeeper: str | None = "it was not asked for"
    memory = _own_memory()
    try:
        own_user = _own_user(spec, grants)
        _end_with(zygote)
        lockdown.drop_capabilities()
        lockdown.forbid_new_privileges()
        if spec["landlock"]:
            landlock = _files(spec, grants)
        if spec["doorkeeper"]:
            without_doorkeeper = _ask_about_paths(memory)
        if spec["seccomp"]:
            lockdown.restrict_system_calls()
            _must_fail("seccomp", lambda: os.open("/", os.O_RDONLY | os.O_TRUNC))
            _must_fail("seccomp", lambda: os.kill(os.getppid(), 0))
            seccomp = True
    except lockdown.LayerMissing as layer:
        missing = str(layer)
    os.closerange(_DOOR, 1 << 8)
    return {
        "do": "sandbox",
        "landlock": landlock,
        "seccomp": seccomp,
        "own_user": own_user,
        "without_doorkeeper": without_doorkeeper,
        "policy": lockdown.POLICY,
        "missing": missing,
    }


def _own_memory() -> int | None:
    """To be had only while this process may be read."""
    with contextlib.suppress(OSError):
        return os.open("/proc/self/mem", os.O_RDONLY)
    return None


def _ask_about_paths(memory: int | None) -> str | None:
    """Have the doorkeeper decide about every path from now on; why it cannot, or None."""
    if memory is None:
        return "/proc/self/mem cannot be opened"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET, fileno=_DOOR) as door:
        try:
            questions = lockdown.ask_about_paths()
        except lockdown.LayerMissing as layer:
            return str(layer)
        doorkeeper.make_known(door, questions, memory)
        os.close(questions)
    _must_fail("doorkeeper", lambda: os.stat("/etc/passwd"))
    return None


def _files(spec: dict[str, Any], grants: lockdown.Grants) -> int:
    folder = os.open(".", os.O_PATH) if spec["folder"] else None
    version = lockdown.restrict_files(lockdown.Grants(grants.read, grants.list_only, folder), spec["landlock"])
    if folder is not None:
        os.close(folder)
    _must_fail("Landlock", lambda: os.open("/etc/passwd", os.O_RDONLY))
    _must_fail("Landlock", lambda: os.listdir("/"))
    return version


def _must_fail(layer: str, attempt: Callable[[], object]) -> None:
    try:
        attempt()
    except OSError:
        return
    raise lockdown.LayerMissing(f"{layer}: it is in place and lets through what it must refuse")
