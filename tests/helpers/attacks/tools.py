"""Tools for attacks inside the child: raw system calls, machine code, and the places of the decoys.

Python's own refusals are disabled first, as any student could do, so that only the kernel's layers are tested.
"""

from __future__ import annotations

import ctypes
import gc
import mmap
import os
import sys
from types import SimpleNamespace

libc = ctypes.CDLL(None, use_errno=True)
libc.syscall.restype = ctypes.c_long
libc.mmap.restype = ctypes.c_void_p

#: The layer that stops an attack. It determines the settings in which the attack must succeed: see ``GETS_THROUGH``.
LANDLOCK, SECCOMP, EITHER, NEWER, REMAINS, UNTRIED = "landlock", "seccomp", "either", "newer", "remains", "untried"
#: Attacks that only the doorkeeper stops, and attacks with no layer to stop them because there is nothing to find.
DOORKEEPER, NOWHERE = "doorkeeper", "nowhere"

#: System call numbers by name, and the decoys; filled before an attack runs.
numbers: dict[str, int] = {}
targets = SimpleNamespace()


def attack(stopped_by):
    """Mark a function as an attack that the layer ``stopped_by`` stops."""

    def mark(function):
        function.stopped_by = stopped_by
        return function

    return mark


def leaves(stopped_by, at_once=False):
    """Mark a function as the first half of an attack: ``function(turn, bit)`` leaves a bit for a later child.

    ``function.finds`` marks the second half: ``find(turn)`` runs in another child, together with the first half if
    ``at_once``. Its result must be consistently larger, or consistently smaller, when the bit is set.
    """

    def mark(function):
        def finds(finder):
            function.find = finder
            return finder

        function.kept_by, function.at_once, function.finds = stopped_by, at_once, finds
        return function

    return mark


def system_calls(stopped_by, **calls):
    """Define one attack for each system call, by name, with its arguments."""
    return {
        name: attack(stopped_by)(lambda name=name, arguments=arguments: call(name, *arguments) >= 0)
        for name, arguments in calls.items()
    }


def call(name, *arguments):
    """Return the result of a raw system call. Raises OSError."""
    number = numbers[name] if isinstance(name, str) else name
    wide = [ctypes.c_long(argument) if isinstance(argument, int) else argument for argument in arguments]
    result = libc.syscall(ctypes.c_long(number), *wide)
    if result == -1:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code), str(name))
    return result


def space(size=256):
    """Return zeroed memory to pass to a call."""
    return ctypes.create_string_buffer(size)


def machine_code(code):
    """Return the number that a piece of x86-64 machine code returns."""
    page = mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
    page.write(code)
    address = ctypes.addressof(ctypes.c_char.from_buffer(page))
    return ctypes.CFUNCTYPE(ctypes.c_long)(address)()


def contents(path, size=64):
    """Return the start of a file, without using Python's file objects."""
    fd = os.open(path, os.O_RDONLY)
    try:
        return os.read(fd, size)
    finally:
        os.close(fd)


def says_leak(program, *arguments):
    """Return shell arguments that run a program and report success on the wire."""
    frame = '{"do":"print","text":"LEAK it ran"}'
    return ["sh", "-c", f"{program} >/dev/null 2>&1; printf '{frame}\\n' >&3", *arguments]


def disarm():
    """Disable the refusals that Python adds by itself."""
    for found in gc.get_objects():
        if getattr(found, "__qualname__", "") == "install_refusals.<locals>.hook":
            for name, cell in zip(found.__code__.co_freevars, found.__closure__, strict=True):
                if name == "folders":
                    cell.cell_contents = ("/",)
            found.__globals__["_MESSAGES"].clear()


def tell(function):
    """Run one half of an attack and print its result, or the reason for its failure."""
    say = sys.stdout.write
    try:
        said = f"found {int(function() or 0)}"
    except BaseException as error:
        said = f"blocked {type(error).__name__}: {error}"
    say(said)


def report(function, start=""):
    """Run an attack and print its result after ``start``."""
    say = sys.stdout.write
    try:
        got = function()
    except BaseException as error:
        say(f"{start}blocked {type(error).__name__}: {error}")
    else:
        say(start + (f"LEAK {got!r}"[:200] if got else "blocked"))
