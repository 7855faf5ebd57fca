"""Modules for responders that replace the notebook's simulator widget."""

from __future__ import annotations

from typing import Any


def load_ipython_extension(shell: Any) -> None:
    """Load the magics into a notebook's kernel. A graded notebook has them without this."""
    from robomark_notebook import load_ipython_extension as load

    load(shell)
