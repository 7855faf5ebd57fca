"""Modules excluded by an assignment. They are not loaded, or hidden from student code if a library needs them.

``grants.py`` also makes the files of modules that are not loaded unreadable. The worker chooses the modules.
"""

from __future__ import annotations

import builtins
import contextlib
import importlib
import importlib.util
import opcode
import os
import sys
from collections.abc import Callable, Iterator
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import FrameType, ModuleType
from typing import Any

_IMPORT_STATEMENT = opcode.opmap["IMPORT_NAME"]


def find_exclusion(module: str, names: tuple[str, ...]) -> str | None:
    """Return the entry of ``names`` that covers the module. The C half of a module has its name with a ``_``."""
    top = module.partition(".")[0]
    halves = {module, module[1:]} if module.startswith("_") and top in sys.stdlib_module_names else {module}
    return next((name for name in names for half in halves if f"{half}.".startswith(f"{name}.")), None)


def describe_exclusion(name: str) -> str:
    """Return the message for importing an excluded module."""
    return f"{name} is not allowed in this assignment"


class _RefusingFinder(MetaPathFinder):
    """Import finder that refuses excluded modules. It comes first in the search order."""

    def __init__(self, refusal: Callable[[str], ImportError | None]) -> None:
        self._refusal = refusal

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        refusal = self._refusal(fullname)
        if refusal is not None:
            raise refusal


def exclude_modules(names: tuple[str, ...]) -> tuple[str, ...]:
    """Prevent the import of these modules. Return the paths of their files.

    Modules that are already loaded, or that loading their package loads, are needed and stay.
    """
    absent: list[str] = []
    sys.meta_path.insert(0, _RefusingFinder(lambda module: _build_error(module, tuple(absent))))
    places: list[str] = []
    # Handle a package before its submodules.
    for name in sorted(names, key=lambda name: name.count(".")):
        specification = None
        with contextlib.suppress(ImportError):
            specification = importlib.util.find_spec(name)
        if name in sys.modules:
            continue
        absent.append(name)
        places += _list_module_paths(specification)
    return tuple(places)


def _list_module_paths(specification: ModuleSpec | None) -> list[str]:
    """Return the folder of a package, or the file of a module and its bytecode folder."""
    if specification is None or specification.origin is None:
        return []
    if specification.submodule_search_locations:
        return list(specification.submodule_search_locations)
    return [specification.origin, os.path.join(os.path.dirname(specification.origin), "__pycache__")]


def hide_modules(names: tuple[str, ...], libraries: tuple[str, ...], report: Callable[[str], None]) -> None:
    """Hide these modules from student code. ``tell(sentence)`` is called for each refusal.

    ``libraries`` are the folders of code that may still import them by an ``import`` statement.
    """
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    loaded_modules = sys.modules
    hidden_modules = {
        name: module for name, module in loaded_modules.items() if find_exclusion(name, names) is not None
    }
    for name in hidden_modules:
        del loaded_modules[name]

    def refusal(module: str) -> ImportError | None:
        error = _build_error(module, names)
        if error is not None:
            report(str(error))
        return error

    @contextlib.contextmanager
    def put_back() -> Iterator[None]:
        loaded_modules.update(hidden_modules)
        try:
            yield
        finally:
            for name in hidden_modules:
                loaded_modules.pop(name, None)

    real_import = builtins.__import__

    def guarded(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> ModuleType:
        package = (globals or {}).get("__package__") or ""
        module = importlib.util.resolve_name("." * level + name, package) if level else name
        module_names = (module, *(f"{module}.{item}" for item in fromlist or () if isinstance(item, str)))
        excluded_name = next((each for each in module_names if find_exclusion(each, names) is not None), None)
        if excluded_name is None:
            return real_import(name, globals, locals, fromlist, level)
        if _is_library_import(sys._getframe(1), libraries):
            with put_back():
                return real_import(name, globals, locals, fromlist, level)
        error = refusal(excluded_name)
        assert error is not None
        raise error

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        # Audit hooks can't be removed, so this one works even if student code bypasses the other two.
        if event == "import" and isinstance(arguments[0], str):
            error = refusal(arguments[0])
            if error is not None:
                raise error

    sys.meta_path.insert(0, _RefusingFinder(refusal))
    builtins.__import__ = guarded
    sys.addaudithook(hook)


def _build_error(module: str, names: tuple[str, ...]) -> ImportError | None:
    name = find_exclusion(module, names)
    return None if name is None else ModuleNotFoundError(describe_exclusion(name), name=module)


def _is_library_import(frame: FrameType, libraries: tuple[str, ...]) -> bool:
    """Return whether the frame is at its own ``import`` statement, not in a call that imports a given name."""
    file = frame.f_code.co_filename
    if not file.startswith((*libraries, "<frozen ")):
        return False
    return frame.f_code.co_code[frame.f_lasti] == _IMPORT_STATEMENT
