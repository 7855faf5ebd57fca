"""Runs a robot program that imports libraries: as any other, but they are loaded before the fork.

Which programs those are is the worker's to say; the others need not wait for them.
"""

from __future__ import annotations

from . import libraries, robot_role

NEEDED = robot_role.NEEDED
run = robot_role.run


def preload(without: list[str]) -> None:
    """What any robot program is prepared with, and the libraries."""
    robot_role.preload(without)
    libraries.preload(without)
