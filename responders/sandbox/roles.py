"""The roles of children, and the folder of our modules that the children of each role import.

Zygotes write no bytecode, so it is compiled here.
"""

from __future__ import annotations

import functools
import importlib.machinery
import importlib.util
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal

ChildRole = Literal["robot", "robot with libraries", "responder", "responder with libraries"]

_FOLDERS: dict[ChildRole, tuple[str, str]] = {
    "robot": ("sim", "brick"),
    "robot with libraries": ("sim", "brick"),
    "responder": ("responders", "kit"),
    "responder with libraries": ("responders", "kit"),
}
ROLES: tuple[ChildRole, ...] = tuple(_FOLDERS)
#: Each role and its variant with loaded libraries.
WITH_LIBRARIES: Mapping[ChildRole, ChildRole] = MappingProxyType(
    {
        "robot": "robot with libraries",
        "robot with libraries": "robot with libraries",
        "responder": "responder with libraries",
        "responder with libraries": "responder with libraries",
    }
)


def find_module_folder(role: ChildRole) -> str:
    """Return the folder of our modules that the children of a role import."""
    package, folder = _FOLDERS[role]
    return str(_find_package_folder(package) / folder)


@functools.cache
def compile_bytecode(folder: Path) -> None:
    """Compile these modules to bytecode on disk, because zygotes write none and would compile them every time."""
    if sys.dont_write_bytecode:
        return
    for file in folder.rglob("*.py"):
        bytecode_file = Path(importlib.util.cache_from_source(file))
        if os.access(file.parent, os.W_OK) and not (
            bytecode_file.exists() and bytecode_file.stat().st_mtime >= file.stat().st_mtime
        ):
            module_spec = importlib.machinery.PathFinder.find_spec(file.stem, [str(file.parent)])
            assert module_spec is not None
            assert isinstance(module_spec.loader, importlib.machinery.SourceFileLoader)
            module_spec.loader.get_code(file.stem)


def _find_package_folder(name: str) -> Path:
    specification = importlib.util.find_spec(name)
    assert specification is not None
    assert specification.submodule_search_locations
    return Path(specification.submodule_search_locations[0]).resolve()
