"""A piece of Python as it is handed over to be run: its name and its text.

It is never run here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Code:
    """A Python file: its name, which its tracebacks show, and its text."""

    name: str
    text: str
