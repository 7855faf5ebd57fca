"""The libraries that student code may use, and their loading before any fork.

Which processes have them is the zygotes' to say; their files are opened by ``grants.py``.
"""

from __future__ import annotations

import contextlib
import importlib

#: As a program names them.
LIBRARIES = ("joblib", "numpy", "pandas", "PIL", "scipy", "sklearn")
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


def _ask_the_machine() -> None:
    """What scikit-learn asks once about libraries and processors, where it may still open files: neighbours need it."""
    import joblib
    from sklearn.utils.parallel import _get_threadpool_controller

    _get_threadpool_controller()
    joblib.cpu_count(only_physical_cores=True)
