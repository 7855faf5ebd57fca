"""``%%blockdiag`` and ``%%seqdiag`` where blockdiag is not installed: the arrows of the diagram, as text."""

from __future__ import annotations

from typing import Any

_ARROWS = ("->", "<-", "--", "=>")


def show_arrows(_line: str, cell: str) -> None:
    """Print each line of a diagram that has an arrow."""
    for line in cell.splitlines():
        if any(arrow in line for arrow in _ARROWS):
            print(line.strip().removesuffix(";"))


def load_ipython_extension(shell: Any) -> None:
    """Register the magics."""
    for name in ("blockdiag", "seqdiag"):
        shell.register_magic_function(show_arrows, "cell", name)
