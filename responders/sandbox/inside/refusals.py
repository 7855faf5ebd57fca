"""Converts refusals of the sandbox into Python errors with a readable message, and reports the place to the worker.

This only helps users. The kernel enforces the refusals.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

from . import excluded_modules
from .lockdown import Grants
from .student_code import StudentFiles

NETWORK = "programs here may not open network connections"
PROGRAMS = "programs here may not start other programs"
FILES = "programs here may only open files in their own folder"
_MAX_REPORTS = 20

_MESSAGES = {
    "socket.__new__": NETWORK,
    "socket.connect": NETWORK,
    "socket.bind": NETWORK,
    "socket.getaddrinfo": NETWORK,
    "os.fork": PROGRAMS,
    "os.forkpty": PROGRAMS,
    "os.exec": PROGRAMS,
    "os.posix_spawn": PROGRAMS,
    "os.spawn": PROGRAMS,
    "os.system": PROGRAMS,
    "subprocess.Popen": PROGRAMS,
    "pty.spawn": PROGRAMS,
}


def install_refusals(grants: Grants, student: StudentFiles, report: Callable[[str], None]) -> None:
    """Install the errors. ``tell(sentence)`` is called for the first few, inside the refused call."""
    folder = os.getcwd()
    own_folders = (folder,) if folder != "/" else ()
    libraries = tuple(path.rstrip("/") + "/" for path in grants.read)
    folders = (*libraries, *(f"{path}/" for path in own_folders))
    files = frozenset((*grants.read, *own_folders))
    reported_refusals: set[tuple[str, str | None, int | None]] = set()

    def note(sentence: str) -> None:
        location = student.locate_frame(sys._getframe())
        refusal = (sentence, location["file"], location["line"])
        if refusal not in reported_refusals and len(reported_refusals) < _MAX_REPORTS:
            reported_refusals.add(refusal)
            report(sentence)

    def refuse(sentence: str) -> PermissionError:
        note(sentence)
        return PermissionError(1, sentence)

    def hook(event: str, args: tuple[Any, ...]) -> None:
        sentence = _MESSAGES.get(event)
        if sentence is not None:
            raise refuse(sentence)
        if event == "open" and isinstance(args[0], str) and args[0].startswith("/"):
            path = args[0]
            if path not in files and not path.startswith(folders):
                if student.has(sys._getframe(1).f_code.co_filename):
                    raise refuse(FILES)
                # Libraries that explore the system are refused too, but the report doesn't mention it.
                raise PermissionError(1, FILES)

    sys.addaudithook(hook)
    if grants.excluded_modules:
        own_sources = (os.path.dirname(__file__), "<preamble>")
        excluded_modules.hide_modules(grants.excluded_modules, (*grants.read, *libraries, *own_sources), note)
