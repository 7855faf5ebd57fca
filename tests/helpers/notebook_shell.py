"""A shell in this process, in which the cells of a notebook run one after another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from IPython.utils.capture import CapturedIO, capture_output


@dataclass(frozen=True)
class NotebookShell:
    """A shell with the extension, and the engine of its robots."""

    shell: Any
    engine: Any

    def run(self, cell: str) -> CapturedIO:
        """Run a cell, and return what it shows. Its errors are among that."""
        with capture_output() as captured:
            self.shell.run_cell(cell, store_history=True)
        return captured

    def text(self, cell: str) -> str:
        """Return everything that a cell shows as text."""
        captured = self.run(cell)
        shown = [str(output.data.get("text/plain", "")) for output in captured.outputs]
        return "\n".join([captured.stdout, captured.stderr, *shown])
