"""A short battery of escape attempts that a child makes when a worker starts. The sandbox must refuse each one.

The full set is in the tests. This one checks the machine at hand, with a kernel that the tests have never run on.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import resource
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from .frames import Wire
from .lockdown import Grants

_libc = ctypes.CDLL(None, use_errno=True)
_BUFFER = ctypes.create_string_buffer(256)


def _build_system_call(number: int, *arguments: int) -> Callable[[], object]:
    """Return a function that makes a raw system call, which fails with a negative number."""

    def attempt() -> object:
        if _libc.syscall(number, *arguments) < 0:
            raise OSError(ctypes.get_errno(), "refused")
        return None

    return attempt


def _start_thread() -> None:
    try:
        threading.Thread(target=lambda: None).start()
    except RuntimeError as error:
        raise OSError(str(error)) from None


def _check_hash_seed() -> None:
    """Fail if texts are not hashed identically in every child, which is decided when the zygote starts."""
    if not sys.flags.hash_randomization:
        raise OSError("refused")


#: The attempts. Each must raise OSError.
ATTEMPTS: dict[str, Callable[[], object]] = {
    "read a system file": lambda: os.open("/etc/passwd", os.O_RDONLY),
    "list the root folder": lambda: os.listdir("/"),
    "write to /tmp": lambda: os.open("/tmp/robomark-battery", os.O_WRONLY | os.O_CREAT),
    "write to shared memory": lambda: os.open("/dev/shm/robomark-battery", os.O_WRONLY | os.O_CREAT),
    "read the parent's environment": lambda: os.open(f"/proc/{os.getppid()}/environ", os.O_RDONLY),
    "open the parent's memory": lambda: os.open(f"/proc/{os.getppid()}/mem", os.O_RDWR),
    "make a link": lambda: os.symlink("/etc/passwd", "robomark-battery"),
    "make a folder": lambda: os.mkdir("robomark-battery"),
    "truncate while reading": lambda: os.open(os.devnull, os.O_RDONLY | os.O_TRUNC),
    "open a network socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
    "open a local socket": lambda: socket.socket(socket.AF_UNIX, socket.SOCK_STREAM),
    "fork": os.fork,
    "start a thread": _start_thread,
    "become another program": lambda: os.execv("/bin/true", ["true"]),
    "signal the parent": lambda: os.kill(os.getppid(), 0),
    "signal everybody": lambda: os.kill(-1, signal.SIGCONT),
    "trace the parent": _build_system_call(101, 16, os.getppid(), 0, 0),
    "read the parent's memory": _build_system_call(310, os.getppid(), 0, 0, 0, 0, 0),
    "make a name space": _build_system_call(272, 0x10000000),
    "set up an I/O ring": _build_system_call(425, 1, 0),
    "load a filter program": _build_system_call(321, 0, 0, 0),
    "make an anonymous file": _build_system_call(319, 0, 0),
    "change the limits": lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)),
    "change a file's mode": lambda: os.chmod(os.devnull, 0o666),
    "make a pipe": os.pipe,
    "count what came from the disk": lambda: resource.getrusage(resource.RUSAGE_SELF),
    "ask how much memory is free": _build_system_call(99, ctypes.addressof(_BUFFER)),
    "read the parent's limits": lambda: resource.prlimit(os.getppid(), resource.RLIMIT_NOFILE),
    "draw the kernel's chance": _build_system_call(318, ctypes.addressof(_BUFFER), 16, 0),
    "open the kernel's chance": lambda: os.open("/dev/urandom", os.O_RDONLY),
    "hash texts by chance": _check_hash_seed,
    "read the parent's clock": lambda: time.clock_gettime((~os.getppid() << 3) | 2),
}

#: Version of the attempts, a hash of this file.
VERSION = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:8]


def run(wire: Wire, _: Grants) -> None:
    """Make all attempts and report those that were not refused."""
    successes = []
    for name, attempt in ATTEMPTS.items():
        try:
            result = attempt()
        except (OSError, ValueError):
            continue
        if name == "fork" and result == 0:
            os._exit(0)
        successes.append(name)
    wire.send({"do": "battery", "version": VERSION, "tried": len(ATTEMPTS), "through": successes})
