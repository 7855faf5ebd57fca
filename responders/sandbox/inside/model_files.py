"""Support for loading students' models in the sandbox: single-threaded runtimes, and readable error messages.

The libraries that wrote the model files read them. No file is trusted.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import os
import sys
import warnings
from collections.abc import Callable
from typing import Any


def preload_runtimes() -> None:
    """Import onnxruntime and ai-edge-litert if available, with one thread each, because the sandbox allows no more."""
    for preload in (_preload_onnxruntime, _preload_litert):
        with contextlib.suppress(ImportError):
            preload()


def _preload_onnxruntime() -> None:
    runtime: Any = importlib.import_module("onnxruntime")

    class InferenceSession(runtime.InferenceSession):  # type: ignore[misc]
        def __init__(self, path_or_bytes: Any, sess_options: Any = None, *args: Any, **more: Any) -> None:
            options = runtime.SessionOptions() if sess_options is None else sess_options
            options.intra_op_num_threads = options.inter_op_num_threads = 1
            super().__init__(path_or_bytes, options, *args, **more)

    runtime.InferenceSession = InferenceSession


def _preload_litert() -> None:
    litert: Any = importlib.import_module("ai_edge_litert.interpreter")

    class Interpreter(litert.Interpreter):  # type: ignore[misc]
        def __init__(self, *args: Any, **more: Any) -> None:
            super().__init__(*args, **more | {"num_threads": 1})

    litert.Interpreter = Interpreter


def explain_joblib_errors() -> None:
    """Make errors of ``joblib.load`` name the file and the cause."""
    import joblib
    from joblib import numpy_pickle

    load = joblib.load

    @functools.wraps(load)
    def load_with_explanation(filename: Any, *args: Any, **options: Any) -> Any:
        file = os.path.basename(filename) if isinstance(filename, str) else "the model"
        try:
            return load(filename, *args, **options)
        except (FileNotFoundError, MemoryError):
            raise
        except PermissionError as error:
            cause = error.args[1] if len(error.args) > 1 else error
            raise PermissionError(f"{file} was stopped while it was loaded: {cause}") from None
        except ModuleNotFoundError as error:
            package = str(error.name).partition(".")[0]
            raise ModuleNotFoundError(
                f"{file} needs the package {package}, which responders here do not have", name=error.name
            ) from None
        except Exception as error:
            cause = f"{type(error).__name__}: {str(error)[:200]}"
            raise ValueError(
                f"{file} cannot be loaded as a model, expected one that joblib.dump or pickle.dump wrote ({cause})"
            ) from None

    joblib.load = numpy_pickle.load = load_with_explanation


def install_version_notes(report: Callable[[str], None]) -> None:
    """Report once per version that a model was saved by another scikit-learn. Other warnings are shown as usual."""
    if "sklearn" not in sys.modules:
        return
    from sklearn.exceptions import InconsistentVersionWarning

    show = warnings.showwarning
    reported_versions: set[str] = set()

    def show_or_report(message: Any, category: Any, *more: Any, **others: Any) -> None:
        if not isinstance(message, InconsistentVersionWarning):
            show(message, category, *more, **others)
            return
        saver, reader = str(message.original_sklearn_version)[:20], str(message.current_sklearn_version)[:20]
        if saver not in reported_versions and len(reported_versions) < 3:
            reported_versions.add(saver)
            sentence = f"a model was saved by scikit-learn {saver} and is read by {reader}; it may answer differently"
            report(sentence)

    warnings.showwarning = show_or_report
