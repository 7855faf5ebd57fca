"""The responders' zygote: what is imported before any fork, and whether a module, an agent or a notebook is to be run.

What runs then is in ``responder_role.py``, ``agent_role.py`` and ``notebook_role.py``.
"""

from __future__ import annotations

import contextlib
import importlib

from . import libraries, model_files, source_reader  # noqa: F401
from .agent_role import AgentRole
from .frames import Wire
from .lockdown import Grants
from .notebook_role import NotebookRole
from .responder_role import ResponderRole

#: What answering takes.
NEEDED = ("nbev3devsim.load_nbev3devwidget", "nbev3devsim.unseen")
_PRELOADED = (
    "json",
    "math",
    "re",
    "statistics",
    "nn_tools.network_views",
    "nn_tools.sensor_data",
    "nn_tools.weights",
)


def preload(without: list[str]) -> None:
    """Import what responders use, before any fork; some of it cannot be had where they are to do ``without``."""
    libraries.preload(without)
    missing = (ImportError,) if without else ()
    for name in _PRELOADED:
        with contextlib.suppress(*missing):
            importlib.import_module(name)
    model_files.preload_runtimes()
    with contextlib.suppress(*missing):
        model_files.explain_joblib()


def run(wire: Wire, grants: Grants) -> None:
    """Receive a module or a notebook, run it, and answer."""
    spec = wire.receive()
    role = NotebookRole if "cells" in spec else AgentRole if "agent" in spec else ResponderRole
    role(wire, grants, spec).run()
