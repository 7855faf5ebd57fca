"""Imports all modules of a package, so that what registers itself where it is defined has done so.

It knows no registry; what a module registers, and where, is the module's.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable


def import_all(package: str, path: Iterable[str]) -> None:
    """Import the modules that lie in ``path``, the ``__path__`` of ``package``; in the order of their names."""
    for name in sorted(found.name for found in pkgutil.iter_modules(path)):
        importlib.import_module(f"{package}.{name}")
