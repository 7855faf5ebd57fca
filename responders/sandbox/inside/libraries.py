"""The libraries that student code may use, and their loading before any fork.

Which processes have them is the zygotes' to say; their files are opened by ``grants.py``.
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

#: As a program names them.
LIBRARIES = ("joblib", "numpy", "pandas", "PIL", "scipy", "sklearn")
#: And what cannot be had without them.
_NEED_THEM = ("nn_tools", "onnxruntime", "ai_edge_litert")
#: What of Python's is loaded before any fork for every responder: these are the same whatever is loaded beside them.
BESIDE = (
    *("__future__", "abc", "ast", "base64", "bisect", "calendar", "collections", "collections.abc", "contextlib"),
    *("copy", "csv", "dataclasses", "datetime", "decimal", "enum", "fractions", "functools", "heapq", "io"),
    *("itertools", "json", "math", "numbers", "operator", "os", "os.path", "pprint", "random", "re", "statistics"),
    *("string", "struct", "sys", "textwrap", "time", "types", "typing"),
)
#: As a person does.
WORDS = "numpy, pandas, scikit-learn, joblib, Pillow and the course's modules"
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


def preload(without: list[str]) -> None:
    """Import them, before any fork; some of it cannot be had where children are to do ``without``."""
    missing = (ImportError,) if without else ()
    for name in _PRELOADED:
        with contextlib.suppress(*missing):
            importlib.import_module(name)
    with contextlib.suppress(*missing):
        _ask_the_machine()


def run_without(run: Callable[[Wire, Grants], None], wire: Wire, grants: Grants) -> None:
    """As ``run``, until one of them is imported after all: then the worker is told, and nothing more is run.

    Loaded this late they would take memory and time from what is the student's, and draw other chance.
    """
    # Behind what refuses those that an assignment does without.
    sys.meta_path.insert(1, _Stops(wire))
    run(wire, grants)


class _Stops(MetaPathFinder):
    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        if fullname.partition(".")[0] in (*LIBRARIES, *_NEED_THEM):
            try:
                self._wire.send({"do": "libraries"})
            finally:
                os._exit(0)


def _ask_the_machine() -> None:
    """What scikit-learn asks once about libraries and processors, where it may still open files: neighbours need it."""
    import joblib
    from sklearn.utils.parallel import _get_threadpool_controller

    _get_threadpool_controller()
    joblib.cpu_count(only_physical_cores=True)
