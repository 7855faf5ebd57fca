"""A Python source file as a value: its name and its text.

This module never executes it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A Python source file: its text, and the name that tracebacks show."""

    name: str
    text: str
