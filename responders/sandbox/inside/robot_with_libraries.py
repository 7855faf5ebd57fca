"""Runs a robot program that imports libraries: as any other, but they are loaded before the fork.

Which programs those are is the worker's to say; the others need not wait for them.
"""

from __future__ import annotations

from . import libraries, robot_role

NEEDED = robot_role.NEEDED
run = robot_role.run
preload = libraries.preload
