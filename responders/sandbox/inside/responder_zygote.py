"""The responders' zygote: what is imported before any fork, and whether a module, an agent or a notebook is to be run.

What runs then is in ``responder_role.py``, ``agent_role.py`` and ``notebook_role.py``; libraries are loaded in
``responder_with_libraries.py`` alone.
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

#: What answering takes.
NEEDED = ("nbev3devsim.load_nbev3devwidget", "nbev3devsim.unseen")


def preload(without: list[str]) -> None:
    """Import what of Python's responders use without needing a library."""
    for name in libraries.BESIDE:
        importlib.import_module(name)


def run(wire: Wire, grants: Grants) -> None:
    """Receive a module or a notebook, run it, and answer."""
    spec = wire.receive()
    role = NotebookRole if "cells" in spec else AgentRole if "agent" in spec else ResponderRole
    role(wire, grants, spec).run()
