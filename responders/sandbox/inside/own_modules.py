"""Imports of the Python files beside the student's code, each as a top-level module.

They come last in the search order, so none replaces a module of Python, the brick or a library. There are no packages,
because submissions are flat.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import CodeType, ModuleType
from typing import Any

from .libraries import LIBRARY_DESCRIPTION
from .student_code import StudentFiles, is_module_file

SourceFunction = Callable[[str], str | None]


def install_importer(
    source: SourceFunction, names: Iterable[str], files: StudentFiles, tell: Callable[[str], None]
) -> None:
    """Install an importer for modules that nothing else provides. ``source`` returns a module's text by name.

    ``tell(sentence)`` is called for each of ``names`` that another module hides.
    """
    for name in sorted(names):
        if _is_taken(name):
            tell(f"{name}.py is never imported: there is another module of that name, which comes first")
    sys.meta_path.append(_OwnModuleFinder(source, files))


def build_source(modules: Mapping[str, str]) -> SourceFunction:
    """Return a source for these modules."""
    return modules.get


def read_folder_module(name: str) -> str | None:
    """Return the current text of a module in the working folder, because cells can write modules too."""
    try:
        with open(f"{name}.py", "rb") as file:
            return importlib.util.decode_source(file.read())
    except OSError:
        return None


def list_folder_modules() -> list[str]:
    """Return the names of the modules in the working folder."""
    return [file.removesuffix(".py") for file in os.listdir() if is_module_file(file)]


def _is_taken(name: str) -> bool:
    if name in sys.modules:
        return True
    with contextlib.suppress(ImportError, ValueError):
        return importlib.util.find_spec(name) is not None
    return False


def _find_importing_code() -> CodeType:
    """Return the code object with the import statement or call."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith((__file__, "<frozen ")):
        frame = frame.f_back
    return frame.f_code


class _OwnModuleFinder(MetaPathFinder, Loader):
    def __init__(self, source: SourceFunction, files: StudentFiles) -> None:
        self._source = source
        self._files = files

    def find_spec(self, fullname: str, path: Any, target: ModuleType | None = None) -> ModuleSpec | None:
        if not fullname.isidentifier():
            return None
        text = self._source(fullname)
        if text is None and self._files.has(_find_importing_code().co_filename):
            raise ModuleNotFoundError(f"No module named {fullname!r}: {LIBRARY_DESCRIPTION} are there", name=fullname)
        if text is None:
            return None
        file = f"{fullname}.py"
        spec = ModuleSpec(fullname, self, origin=file, loader_state=text)
        spec.has_location = True
        return spec

    def create_module(self, spec: ModuleSpec) -> None:
        """Return None for a standard module object."""

    def exec_module(self, module: ModuleType) -> None:
        spec = module.__spec__
        assert spec is not None
        assert spec.origin is not None
        self._files.imported.add(spec.origin)
        self._files.execute(spec.loader_state, spec.origin, module.__dict__)
