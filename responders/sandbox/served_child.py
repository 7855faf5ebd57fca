"""The interface of a child for the code that serves it.

``running_child.py`` implements it for a process, ``responders/repeated_faults.py`` for recorded frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from responders import wire
from sim.errors import RobomarkError


class LibrariesNeeded(RobomarkError):
    """Raised when a child without libraries has imported one: the trial must be run again with libraries."""


class ServedChild(Protocol):
    """The interface of a child for the code that serves it."""

    sandbox: str

    def send(self, frame: dict[str, Any], entries: Sequence[str] = ()) -> None:
        """Send one frame. ``entries`` holds JSON texts."""

    def send_readings(self, units: int, values: Sequence[float]) -> None:
        """Send readings, without arrivals."""

    def receive(self, schema: wire.Schema) -> wire.Frame:
        """Return the next frame.

        Raises:
            ChildStopped: If the child was stopped or has ended.
        """

    def measure_cpu_seconds(self) -> float:
        """Return the CPU seconds of the child so far."""

    def stop_and_locate(self) -> wire.Frame:
        """Return the current ``line`` and ``file`` of the child, and stop it: it can't be served afterwards."""

    def close(self) -> None:
        """End the child."""
