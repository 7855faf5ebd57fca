"""The role of a robot program that imports libraries, which are loaded before the fork.

The worker decides which programs use it. The others start faster without it.
"""

from __future__ import annotations

from . import libraries, robot_role

NEEDED = robot_role.NEEDED
run = robot_role.run


def preload(exclusions: list[str]) -> None:
    """Make the preparations of ``robot_role`` and import the libraries."""
    robot_role.preload(exclusions)
    libraries.preload(exclusions)
