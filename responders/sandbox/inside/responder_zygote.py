"""The zygote of responders: imports before any fork, and the choice between a module, an agent and a notebook.

The roles are in ``responder_role.py``, ``agent_role.py`` and ``notebook_role.py``. Only ``responder_with_libraries.py``
loads libraries.
"""

from __future__ import annotations

import importlib

from . import libraries
from .agent_role import AgentRole
from .frames import Wire
from .lockdown import Grants
from .notebook_role import NotebookRole
from .responder_role import ResponderRole
from .static_analysis import reader  # noqa: F401

#: Modules needed for answering.
NEEDED = ("nbev3devsim.load_nbev3devwidget", "nbev3devsim.placeholders")


def preload(exclusions: list[str]) -> None:
    """Import the standard modules that responders use without a library."""
    for name in libraries.STANDARD_MODULES:
        importlib.import_module(name)


def run(wire: Wire, grants: Grants) -> None:
    """Receive a module or a notebook, run it, and answer."""
    spec = wire.receive()
    role = NotebookRole if "cells" in spec else AgentRole if "agent" in spec else ResponderRole
    role(wire, grants, spec).run()
