"""Attacks on the child's own memory: it must contain no data of the worker, the zygote or the previous student.

The marks to find are passed to the attack scrambled, so that it does not find its own search terms.
"""

from __future__ import annotations

import ctypes
import fcntl
import gc
import os
import sys

from attacks.tools import UNTRIED, attack, libc, targets


def needles():
    return [bytes(byte ^ 0x5A for byte in bytes.fromhex(text)) for text in targets.scrambled]


def _holds(value):
    try:
        data = value if isinstance(value, bytes | bytearray) else str(value).encode("utf-8", "replace")
    except Exception:
        return False
    return any(needle in data for needle in needles())


@attack(UNTRIED)
def walk_all_objects():
    return any(
        _holds(each)
        for found in gc.get_objects()
        if isinstance(found, dict | list | tuple)
        for each in (found.values() if isinstance(found, dict) else found)
        if isinstance(each, str | bytes | bytearray)
    )


@attack(UNTRIED)
def walk_all_frames():
    frame = sys._getframe()
    while frame is not None:
        if any(_holds(value) for value in frame.f_locals.values() if isinstance(value, str | bytes)):
            return True
        frame = frame.f_back
    return False


@attack(UNTRIED)
def find_the_graders_modules():
    return [name for name in sys.modules if name.split(".")[0] in ("service", "submissions", "models", "responders")]


@attack(UNTRIED)
def find_secrets_in_the_environment():
    return any(_holds(name) or _holds(value) for name, value in os.environ.items())


@attack(UNTRIED)
def find_secrets_in_the_first_environment():
    """The initial environment stays in the memory of the C library, even after os.environ changes."""
    start = ctypes.POINTER(ctypes.c_char_p).in_dll(libc, "environ")
    place = 0
    while start and start[place]:
        if _holds(start[place]):
            return True
        place += 1
    return False


@attack(UNTRIED)
def scan_the_heap():
    """Scan the heap from start to end, as used by the C library and small Python objects."""
    libc.sbrk.restype = ctypes.c_void_p
    end = libc.sbrk(0)
    data = bytearray()
    address = id(object()) & ~0xFFFFF
    for block in (address, (end or 0) - (1 << 20)):
        if block > 0:
            try:
                data += _read(block, 1 << 20)
            except OSError:
                continue
    return _holds(data)


def _read(address, size):
    """Read through a pipe, so that an unmapped address raises an error and does not end the process."""
    reading, writing = os.pipe()
    found = bytearray()
    try:
        for offset in range(0, size, 4096):
            got = libc.write(writing, ctypes.c_void_p(address + offset), 4096)
            if got > 0:
                found += os.read(reading, got)
    finally:
        os.close(reading)
        os.close(writing)
    return found


@attack(UNTRIED)
def find_stray_descriptors():
    """Only the null device (three times) and the two ends of the wire may be open."""
    found = []
    for fd in range(5, 1200):
        try:
            fcntl.fcntl(fd, fcntl.F_GETFD)
            found.append(fd)
        except OSError:
            continue
    return found


@attack(UNTRIED)
def find_something_on_the_standard_descriptors():
    import stat

    return [fd for fd in range(3) if not stat.S_ISCHR(os.fstat(fd).st_mode) or os.fstat(fd).st_rdev != 0x103]


@attack(UNTRIED)
def find_the_zygotes_control_socket():
    """The Python object of the socket may remain, but its descriptor number now belongs to the child's wire."""
    import socket

    found = [each for each in gc.get_objects() if isinstance(each, socket.socket) and each.fileno() not in (-1, 3)]
    return found


@attack(UNTRIED)
def read_what_is_still_in_the_wire():
    os.set_blocking(4, False)
    try:
        return os.read(4, 65536)
    except BlockingIOError:
        return False
