"""Suggestions for name and import errors: a similar name, or a missing import.

They use only data of the error and change nothing. The worker doesn't trust them.
"""

from __future__ import annotations

import builtins
import difflib
import keyword
import os
import re
import sys
from collections.abc import Iterable
from types import ModuleType

_MAX_NAME_LENGTH = 60
_MAX_KNOWN_NAMES = 5000
_CANNOT_IMPORT = re.compile(r"cannot import name '(\w+)' from '([\w.]+)'")
#: Import statements for names that are often used without one.
_IMPORTS = {
    "np": "import numpy as np",
    "pd": "import pandas as pd",
    "sleep": "from time import sleep",
    "randint": "from random import randint",
    "pyState": "from ev3dev2_glue import pyState",
    "load": "from joblib import load",
}
#: Builtins of an interactive Python, which no program means.
_INTERACTIVE_NAMES = frozenset({"copyright", "credits", "license", "exit", "quit", "help"})
#: Functions of modules by their names in other languages and libraries.
_FOREIGN_NAMES = {
    "time": {"wait": "sleep", "pause": "sleep", "delay": "sleep", "now": "time"},
    "random": {"rand": "random", "number": "randint", "pick": "choice", "int": "randint"},
    "math": {"power": "pow", "root": "sqrt"},
    "json": {"parse": "loads", "stringify": "dumps", "encode": "dumps", "decode": "loads"},
}
#: Modules that are suggested before standard modules with similar names.
_LIBRARIES = ("joblib", "json", "matplotlib", "nbev3devsim", "nn_tools", "numpy", "pandas", "sklearn", "time")
#: Brick modules that a robot program may not have loaded yet.
_BRICK = ("ev3dev2", "ev3dev2.motor", "ev3dev2.sensor", "ev3dev2.sensor.lego", "ev3dev2.sound", "ev3dev2_glue")


def suggest_fix(error: BaseException) -> str:
    """Return a sentence with a suggestion, or "" if there is none."""
    try:
        if isinstance(error, UnboundLocalError):
            return ""
        if isinstance(error, NameError):
            return _suggest_for_name(error)
        if isinstance(error, AttributeError) and error.name is not None:
            return _suggest_module_function(error) or _suggest_near_name(error.name, dir(error.obj), 0.7)
        if isinstance(error, ModuleNotFoundError) and str(error).startswith("No module named"):
            brick_modules = _BRICK if "brick_link" in sys.modules else ()
            name = str(error.name)
            return _suggest_near_name(name, [*brick_modules, *_LIBRARIES], 0.8) or _suggest_near_name(
                name, [*sys.stdlib_module_names, *sys.modules], 0.8
            )
        if isinstance(error, FileNotFoundError) and isinstance(error.filename, str) and os.getcwd() != "/":
            return _suggest_near_name(error.filename, os.listdir(), 0.7)
        import_match = _CANNOT_IMPORT.search(str(error)) if isinstance(error, ImportError) else None
        return _suggest_near_name(import_match[1], dir(sys.modules.get(import_match[2])), 0.7) if import_match else ""
    except Exception:
        # ``dir`` may run code of the student's objects, which may raise anything.
        return ""


def _suggest_for_name(error: NameError) -> str:
    name = str(error.name)
    statement = f"import {name}" if name in sys.stdlib_module_names else _IMPORTS.get(name)
    if statement is not None:
        return f"Did you forget {statement}?"
    known_names: list[str] = [each for each in (*dir(builtins), *keyword.kwlist) if each not in _INTERACTIVE_NAMES]
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is not None:
        known_names = [*trace.tb_frame.f_locals, *trace.tb_frame.f_globals, *known_names]
    return _suggest_near_name(name, known_names, 0.7)


def _suggest_module_function(error: AttributeError) -> str:
    module = getattr(error.obj, "__name__", "") if isinstance(error.obj, ModuleType) else ""
    function_name = _FOREIGN_NAMES.get(module, {}).get(str(error.name).lower())
    return f"Did you mean {module}.{function_name}?" if function_name else ""


def _suggest_near_name(name: str, known_names: Iterable[object], cutoff: float) -> str:
    """Return ``Did you mean print?`` for the best match of ``name`` among ``known_names``, or ""."""
    names = [each for each in known_names if type(each) is str and len(each) <= _MAX_NAME_LENGTH][:_MAX_KNOWN_NAMES]
    if name in names or len(name) > _MAX_NAME_LENGTH:
        return ""
    candidates = {_normalise_name(each): each for each in reversed(names) if not each.startswith("_")}
    matches = difflib.get_close_matches(_normalise_name(name), candidates, 1, cutoff)
    return f"Did you mean {candidates[matches[0]]}?" if matches else ""


def _normalise_name(name: str) -> str:
    return name.lower().replace("_", "")
