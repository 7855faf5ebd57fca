"""Which files of a submission are code that nobody can read: compiled modules, libraries, archives of modules.

Python would import them from the folder like any module. Model files, archives of arrays among them, are none.
"""

from __future__ import annotations

from io import BytesIO

from sim.readers.unreadable import Unreadable
from sim.readers.zip_archive import is_zip, open_zip

_SUFFIXES = (".pyc", ".pyo", ".pyd", ".so", ".egg", ".whl")
_MODULES = (".py", *_SUFFIXES)
_ELF = b"\x7fELF"
#: What is looked at in an archive; zipfile makes an object of each entry.
_MOST_ENTRIES = 2000


def is_compiled(name: str, data: bytes) -> bool:
    """By its name, or by what it is whatever it is called."""
    return name.lower().endswith(_SUFFIXES) or data.startswith(_ELF) or _has_modules(data)


def _has_modules(data: bytes) -> bool:
    """Whether it is an archive, however it begins, from which Python could import; one that is too large may be."""
    if not is_zip(BytesIO(data)):
        return False
    try:
        with open_zip(BytesIO(data), _MOST_ENTRIES) as archive:
            return any(entry.lower().endswith(_MODULES) for entry in archive.namelist())
    except Unreadable:
        return True
