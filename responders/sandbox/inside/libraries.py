"""The libraries available to student code, and their import before any fork.

The zygotes decide which processes have them. ``grants.py`` makes their files readable.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Callable
from importlib.abc import MetaPathFinder

from .frames import Wire
from .lockdown import Grants

#: Import names.
LIBRARIES = ("joblib", "numpy", "pandas", "PIL", "scipy", "sklearn")
#: Modules that need them.
_DEPENDENT_MODULES = ("nn_tools", "onnxruntime", "ai_edge_litert")
#: Standard modules that every responder's zygote imports before any fork, so that they are the same with and without
#: libraries.
STANDARD_MODULES = (
    *("__future__", "abc", "ast", "base64", "bisect", "calendar", "collections", "collections.abc", "contextlib"),
    *("copy", "csv", "dataclasses", "datetime", "decimal", "enum", "fractions", "functools", "heapq", "io"),
    *("itertools", "json", "math", "numbers", "operator", "os", "os.path", "pprint", "random", "re", "statistics"),
    *("string", "struct", "sys", "textwrap", "time", "types", "typing"),
)
#: Names for messages.
LIBRARY_DESCRIPTION = "numpy, pandas, scikit-learn, joblib, Pillow and the course's modules"
_PRELOADED = (
    "joblib",
    "numpy",
    "numpy.random",
    "pandas",
    "PIL.Image",
    "sklearn.ensemble",
    "sklearn.linear_model",
    "sklearn.metrics",
    "sklearn.model_selection",
    "sklearn.neighbors",
    "sklearn.neural_network",
    "sklearn.pipeline",
    "sklearn.preprocessing",
    "sklearn.svm",
    "sklearn.tree",
)


def preload(exclusions: list[str]) -> None:
    """Import the libraries before any fork. Imports may fail if children don't have all of them (``exclusions``)."""
    tolerated_errors = (ImportError,) if exclusions else ()
    for name in _PRELOADED:
        with contextlib.suppress(*tolerated_errors):
            importlib.import_module(name)
    with contextlib.suppress(*tolerated_errors):
        _query_machine()


def run_without_libraries(run: Callable[[Wire, Grants], None], wire: Wire, grants: Grants) -> None:
    """Call ``run`` without libraries. An import of one is reported to the worker and ends the process.

    Libraries loaded this late would use the student's memory and time, and other random draws.
    """
    # After the finder that refuses modules excluded by the assignment.
    sys.meta_path.insert(1, _StoppingFinder(wire))
    run(wire, grants)


class _StoppingFinder(MetaPathFinder):
    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        if fullname.partition(".")[0] in (*LIBRARIES, *_DEPENDENT_MODULES):
            try:
                self._wire.send({"do": "libraries"})
            finally:
                os._exit(0)


def _query_machine() -> None:
    """Trigger scikit-learn's queries about libraries and processors while files can be opened: neighbours need them."""
    import joblib
    from sklearn.utils.parallel import _get_threadpool_controller

    _get_threadpool_controller()
    joblib.cpu_count(only_physical_cores=True)
