"""Modules that an assignment does without: what can be absent is never loaded, what libraries need is put away.

The files of what is absent are closed by the kernel as well (``grants.py``); which modules these are is the worker's
to say.
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


def rule_for(module: str, names: tuple[str, ...]) -> str | None:
    """The one of ``names`` that the module is, or belongs to; the C half of a module has its name with a ``_``."""
    top = module.partition(".")[0]
    halves = {module, module[1:]} if module.startswith("_") and top in sys.stdlib_module_names else {module}
    return next((name for name in names for half in halves if f"{half}.".startswith(f"{name}.")), None)


def sentence(name: str) -> str:
    """What a student is told when importing what the assignment withholds."""
    return f"this assignment does without {name}"


class _Refuses(MetaPathFinder):
    """The first to be asked for any module that is not loaded."""

    def __init__(self, refusal: Callable[[str], ImportError | None]) -> None:
        self._refusal = refusal

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        refusal = self._refusal(fullname)
        if refusal is not None:
            raise refusal


def keep_out(names: tuple[str, ...]) -> tuple[str, ...]:
    """Let none of these be loaded from now on; where their files are.

    What is loaded by now, or by loading the package that it is in, is needed, and stays.
    """
    absent: list[str] = []
    sys.meta_path.insert(0, _Refuses(lambda module: _error(module, tuple(absent))))
    places: list[str] = []
    # A package is named before what is in it.
    for name in sorted(names, key=lambda name: name.count(".")):
        specification = None
        with contextlib.suppress(ImportError):
            specification = importlib.util.find_spec(name)
        if name in sys.modules:
            continue
        absent.append(name)
        places += _places(specification)
    return tuple(places)


def _places(specification: ModuleSpec | None) -> list[str]:
    """The folder of a package, or the file of a module and the folder with what was compiled of it."""
    if specification is None or specification.origin is None:
        return []
    if specification.submodule_search_locations:
        return list(specification.submodule_search_locations)
    return [specification.origin, os.path.join(os.path.dirname(specification.origin), "__pycache__")]


def put_away(names: tuple[str, ...], libraries: tuple[str, ...], tell: Callable[[str], None]) -> None:
    """Refuse these to student code; ``tell(sentence)`` each time.

    ``libraries`` are the folders of code that may still import, by a statement, what was loaded before.
    """
    for name in names:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    loaded = sys.modules
    kept = {name: module for name, module in loaded.items() if rule_for(name, names) is not None}
    for name in kept:
        del loaded[name]

    def refusal(module: str) -> ImportError | None:
        error = _error(module, names)
        if error is not None:
            tell(str(error))
        return error

    @contextlib.contextmanager
    def put_back() -> Iterator[None]:
        loaded.update(kept)
        try:
            yield
        finally:
            for name in kept:
                loaded.pop(name, None)

    real_import = builtins.__import__

    def guarded(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> ModuleType:
        package = (globals or {}).get("__package__") or ""
        module = importlib.util.resolve_name("." * level + name, package) if level else name
        wanted = (module, *(f"{module}.{item}" for item in fromlist or () if isinstance(item, str)))
        found = next((each for each in wanted if rule_for(each, names) is not None), None)
        if found is None:
            return real_import(name, globals, locals, fromlist, level)
        if _is_statement_of_a_library(sys._getframe(1), libraries):
            with put_back():
                return real_import(name, globals, locals, fromlist, level)
        error = refusal(found)
        assert error is not None
        raise error

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        # Below Python, and whatever becomes of the two above: nobody can take a hook away.
        if event == "import" and isinstance(arguments[0], str):
            error = refusal(arguments[0])
            if error is not None:
                raise error

    sys.meta_path.insert(0, _Refuses(refusal))
    builtins.__import__ = guarded
    sys.addaudithook(hook)


def _error(module: str, names: tuple[str, ...]) -> ImportError | None:
    name = rule_for(module, names)
    return None if name is None else ModuleNotFoundError(sentence(name), name=module)


def _is_statement_of_a_library(frame: FrameType, libraries: tuple[str, ...]) -> bool:
    """Whether the frame is in the middle of an ``import`` of its own, not of a call that imports what it is told."""
    file = frame.f_code.co_filename
    if not file.startswith((*libraries, "<frozen ")):
        return False
    return frame.f_code.co_code[frame.f_lasti] == _IMPORT_STATEMENT
