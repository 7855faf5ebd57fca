"""The costs of a job's children to the worker: stored bytes, processor time and real time asleep.

Costs are charged before data is stored, so they bound the worker's own memory and time. ``running_child.py`` applies
the limits of a single child.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.errors import HostError, RobomarkError
from sim.recording import Verdict

#: Cost of a stored object in addition to its text.
OBJECT_BYTES = 256
#: Sleep that is free for each child, because replies take time, especially on a busy machine.
_FREE_SLEEP_SECONDS = 0.5


class ChildStopped(Exception):
    """Raised when a child has been stopped or has ended, with the reason and the line if known.

    The line is one of the main file, or of ``file`` beside it.
    """

    def __init__(self, verdict: Verdict, message: str, line: int | None = None, file: str | None = None) -> None:
        super().__init__(message)
        self.verdict, self.message, self.line, self.file = verdict, message, line, file


@dataclass(frozen=True, slots=True)
class JobLimits:
    """Limits for all trials of a job together: bytes stored, processor seconds, and real seconds asleep."""

    kept_bytes: int = 64 << 20
    cpu_seconds: float = 150.0
    sleep_seconds: float = 20.0


@dataclass(frozen=True, slots=True)
class JobCosts:
    """The costs of a job so far."""

    kept_bytes: int = 0
    cpu_seconds: float = 0.0
    sleep_seconds: float = 0.0


class JobMeter:
    """Counts the costs of one job. ``heartbeat`` runs several times a second and may raise to end the job."""

    def __init__(self, limits: JobLimits = JobLimits(), heartbeat: Callable[[], None] = lambda: None) -> None:
        self._limits = limits
        self._heartbeat = heartbeat
        self._kept_bytes = 0
        self._cpu = self._sleep = 0.0  # of ended children

    @property
    def spent(self) -> JobCosts:
        """The costs of the job so far. Seconds include only ended children."""
        return JobCosts(self._kept_bytes, self._cpu, self._sleep)

    @property
    def limits(self) -> JobLimits:
        """The limits of the job."""
        return self._limits

    def extend(self, limits: JobLimits) -> None:
        """Replace the limits. The costs so far remain."""
        self._limits = limits

    def heartbeat(self) -> None:
        """Call the heartbeat. An unexpected exception from it is a host fault, never a child's."""
        try:
            self._heartbeat()
        except RobomarkError:
            raise
        except Exception as error:
            raise HostError(f"the job's heartbeat failed: {type(error).__name__}: {error}") from error

    def charge_bytes(self, size: int) -> None:
        """Charge for an object with ``size`` bytes of text before it is stored.

        Raises:
            ChildStopped: If the job exceeds its limit.
        """
        self._kept_bytes += size + OBJECT_BYTES
        if self._kept_bytes > self._limits.kept_bytes:
            raise ChildStopped(
                Verdict.OUTPUT_LIMIT,
                f"all trials together said more than {self._limits.kept_bytes >> 20} MB, counting messages and images",
            )

    def charge_cpu(self, seconds: float) -> None:
        """Charge processor time of the worker itself. The limit is checked while a child runs."""
        self._cpu += seconds

    def check_cpu(self, running: float) -> None:
        """Check the limit on processor time. ``running`` is the time of the current child.

        Raises:
            ChildStopped: If the job exceeds its limit.
        """
        if self._cpu + running > self._limits.cpu_seconds:
            raise ChildStopped(
                Verdict.CPU_LIMIT,
                "all trials together computed for longer than a submission may",
            )

    def check_sleep(self, running: float) -> None:
        """Check the limit on sleep. ``running`` is the sleep of the current child.

        Raises:
            ChildStopped: If the job exceeds its limit.
        """
        if self._sleep + max(0.0, running - _FREE_SLEEP_SECONDS) > self._limits.sleep_seconds:
            raise ChildStopped(
                Verdict.STALLED,
                f"all trials together slept for more than {self._limits.sleep_seconds:g} seconds of real time",
            )

    def charge_child(self, cpu_seconds: float, sleep_seconds: float) -> None:
        """Count the seconds of an ended child. The first seconds asleep are free."""
        self._cpu += cpu_seconds
        self._sleep += max(0.0, sleep_seconds - _FREE_SLEEP_SECONDS)

    def refund_since(self, earlier_costs: JobCosts) -> None:
        """Refund the costs since ``earlier_costs``, because the host caused the failure."""
        self._kept_bytes, self._cpu, self._sleep = (
            earlier_costs.kept_bytes,
            earlier_costs.cpu_seconds,
            earlier_costs.sleep_seconds,
        )
