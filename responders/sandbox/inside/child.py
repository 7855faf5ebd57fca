"""The start of a child, from the fork to the student code: activates the sandbox layers and drops the zygote's data.

The role (robot program or responder) starts when all layers are active.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import os
import resource
import signal
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import doorkeeper, lockdown
from .frames import Frame, Wire

_PR_SET_PDEATHSIG = 1
_PR_SET_DUMPABLE = 4

_WRITING, _READING, _DOOR = 3, 4, 5
#: User ids for children, one each. Nothing on a machine should belong to them.
_USERS, _USERS_COUNT = 61_000, 4_000
#: Signals that Python ignores from its start, to raise an error instead.
_PYTHON_SIGNALS = frozenset((signal.SIGPIPE, signal.SIGXFSZ))


@dataclass(frozen=True)
class ChildSetup:
    """Values that a zygote computes once for all its children."""

    grants: lockdown.Grants
    rules: tuple[bytes, ...]  # Landlock rules for the grants
    changed_signals: tuple[int, ...]
    zygote: int  # process id of the zygote
    door: int  # descriptor for registering a child with the doorkeeper


def list_changed_signals() -> tuple[int, ...]:
    """Return the signals with a handling other than the default, except those that Python itself changes.

    A worker that a shell started in the background ignores some signals, and its forks would inherit that.
    """
    numbers = signal.valid_signals() - _PYTHON_SIGNALS - {signal.SIGKILL, signal.SIGSTOP}
    return tuple(int(number) for number in numbers if signal.getsignal(number) is not signal.SIG_DFL)


def run_child(
    spec: dict[str, Any], descriptors: list[int], role: Callable[[Wire, lockdown.Grants], None], setup: ChildSetup
) -> None:
    """Run a child to its end; never returns.

    ``descriptors`` are the wire's two and, if the spec has a folder, the folder.
    """
    try:
        lockdown.pin_to_processors(bytes.fromhex(spec["processors"]))
        _start_session(setup.changed_signals)
        _raise_oom_score()
        _set_descriptors([*descriptors[:2], setup.door, *descriptors[2:]])
        _set_limits(spec)
        wire = Wire(_WRITING, _READING)
        wire.send(_activate_layers(spec, setup))
        gc.enable()
        gc.collect()  # so that the collector runs at the same allocations in every child
        role(wire, dataclasses.replace(setup.grants, excluded_modules=tuple(spec["without"])))
    finally:
        os._exit(0)


def _start_session(changed_signals: tuple[int, ...]) -> None:
    os.setsid()
    for number in changed_signals:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _raise_oom_score() -> None:
    """Make the kernel kill this child before its zygote when memory runs out.

    The /proc files of a non-dumpable process, such as the zygote, belong to root. So this process is dumpable until it
    is locked down.
    """
    lockdown.set_process_option(_PR_SET_DUMPABLE, 1)
    with contextlib.suppress(OSError):
        score = os.open("/proc/self/oom_score_adj", os.O_WRONLY)
        os.write(score, b"1000")
        os.close(score)


def _switch_user(spec: dict[str, Any], grants: lockdown.Grants) -> bool:
    """As root, switch to a user without any files, if the interpreter is readable for that user."""
    if not grants.open_to_others or not lockdown.can_change_user():
        return False
    user = _USERS + os.getpid() % _USERS_COUNT
    if spec["folder"]:
        for name in [".", *os.listdir()]:
            os.chown(name, user, user, follow_symlinks=False)
    lockdown.switch_user(user)
    return True


def _end_with_zygote(zygote: int) -> None:
    """End this process with the zygote. A change of user resets both settings, so call this afterwards."""
    lockdown.set_process_option(_PR_SET_PDEATHSIG, signal.SIGKILL)
    lockdown.set_process_option(_PR_SET_DUMPABLE, 0)
    if os.getppid() != zygote:
        os._exit(0)


def _set_descriptors(descriptors: list[int]) -> None:
    """Set descriptors 0 to 2 to the null device, then the wire and the door. Change to the folder.

    Descriptors for the rules stay open until the layers are active, and all others are closed.
    """
    high_descriptors = [os.dup2(fd, 100 + place) for place, fd in enumerate(descriptors)]
    null = os.open(os.devnull, os.O_RDWR)
    for fd in (0, 1, 2):
        os.dup2(null, fd)
    for fd, high_descriptor in zip((_WRITING, _READING, _DOOR), high_descriptors, strict=False):
        os.dup2(high_descriptor, fd)
    os.chdir(high_descriptors[3] if len(high_descriptors) > 3 else "/")
    os.closerange(_DOOR + 1, lockdown.LOWEST_DESCRIPTOR)
    os.umask(0o077)


def _set_limits(spec: dict[str, Any]) -> None:
    """Limit the address space beyond the zygote's, CPU time as a backstop, file size, and descriptors."""
    with open("/proc/self/statm", "rb") as statm:
        mapped_bytes = int(statm.read().split()[0]) * resource.getpagesize()
    memory = mapped_bytes + spec["memory"]
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    seconds = 2 * int(spec["cpu"]) + 2  # twice the limit, because the worker may watch it for that long
    # The worker acts long before the hard limit, so a SIGKILL that it did not send has another cause.
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 60))
    resource.setrlimit(resource.RLIMIT_FSIZE, (spec["file_size"], spec["file_size"]))
    resource.setrlimit(resource.RLIMIT_NOFILE, (32, 32))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
    resource.setrlimit(resource.RLIMIT_MSGQUEUE, (0, 0))
    resource.setrlimit(resource.RLIMIT_SIGPENDING, (0, 0))


def _activate_layers(spec: dict[str, Any], setup: ChildSetup) -> Frame:
    """Activate the layers in the spec, test each, and report them. No student code has run yet."""
    missing_layer = None
    landlock, seccomp, own_user = 0, False, False
    without_doorkeeper: str | None = "it was not asked for"
    memory = _open_memory()
    fixed_addresses = lockdown.has_fixed_addresses()
    try:
        own_user = _switch_user(spec, setup.grants)
        _end_with_zygote(setup.zygote)
        lockdown.drop_capabilities()
        lockdown.forbid_new_privileges()
        if spec["landlock"]:
            landlock = _restrict_files(spec, setup.rules)
        if spec["doorkeeper"]:
            without_doorkeeper = _activate_doorkeeper(memory)
        if spec["seccomp"]:
            lockdown.restrict_system_calls()
            _check_refused("seccomp", lambda: os.open("/", os.O_RDONLY | os.O_TRUNC))
            _check_refused("seccomp", lambda: os.kill(os.getppid(), 0))
            seccomp = True
    except lockdown.LayerMissing as layer:
        missing_layer = str(layer)
    os.closerange(_DOOR, 1 << 16)
    return {
        "do": "sandbox",
        "landlock": landlock,
        "seccomp": seccomp,
        "own_user": own_user,
        "fixed_addresses": fixed_addresses,
        "without_doorkeeper": without_doorkeeper,
        "policy": lockdown.POLICY,
        "missing": missing_layer,
    }


def _open_memory() -> int | None:
    """Return a descriptor of this process's memory. It can be opened only while the process is dumpable."""
    with contextlib.suppress(OSError):
        return os.open("/proc/self/mem", os.O_RDONLY)
    return None


def _activate_doorkeeper(memory: int | None) -> str | None:
    """Activate the doorkeeper, which checks every path. Return the reason if that fails, otherwise None."""
    if memory is None:
        return "/proc/self/mem cannot be opened"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET, fileno=_DOOR) as door:
        try:
            questions = lockdown.install_path_filter()
        except lockdown.LayerMissing as layer:
            return str(layer)
        doorkeeper.register_child(door, questions, memory)
        os.close(questions)
    _check_refused("doorkeeper", lambda: os.stat("/etc/passwd"))
    return None


def _restrict_files(spec: dict[str, Any], rules: tuple[bytes, ...]) -> int:
    if spec["folder"]:
        folder = os.open(".", os.O_PATH)
        rules = *rules, lockdown.build_writing_rule(folder, spec["landlock"])
    version = lockdown.restrict_files(rules, spec["landlock"])
    _check_refused("Landlock", lambda: os.open("/etc/passwd", os.O_RDONLY))
    _check_refused("Landlock", lambda: os.listdir("/"))
    return version


def _check_refused(layer: str, attempt: Callable[[], object]) -> None:
    try:
        attempt()
    except OSError:
        return
    raise lockdown.LayerMissing(f"{layer}: it is in place and lets through what it must refuse")
