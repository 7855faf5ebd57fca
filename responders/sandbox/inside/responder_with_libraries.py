"""The zygote of responders that may need libraries, which are loaded before the fork.

The worker decides which responders use it. The others start faster without it.
"""

from __future__ import annotations

import contextlib
import importlib

from . import libraries, model_files, responder_zygote

NEEDED = responder_zygote.NEEDED
run = responder_zygote.run
_COURSE_MODULES = ("nn_tools.network_views", "nn_tools.sensor_data", "nn_tools.weights")


def preload(exclusions: list[str]) -> None:
    """Import the modules of responders before any fork. Some may fail without the modules in ``exclusions``."""
    responder_zygote.preload(exclusions)
    libraries.preload(exclusions)
    tolerated_errors = (ImportError,) if exclusions else ()
    for name in _COURSE_MODULES:
        with contextlib.suppress(*tolerated_errors):
            importlib.import_module(name)
    model_files.preload_runtimes()
    with contextlib.suppress(*tolerated_errors):
        model_files.explain_joblib_errors()
