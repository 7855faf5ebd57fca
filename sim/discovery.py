"""Import of all modules of a package, so that they register their contents.

The modules themselves decide what they register, and in which registry.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable


def import_all(package: str, path: Iterable[str]) -> None:
    """Import the modules in ``path``, the ``__path__`` of ``package``, in alphabetical order."""
    for name in sorted(found.name for found in pkgutil.iter_modules(path)):
        importlib.import_module(f"{package}.{name}")
