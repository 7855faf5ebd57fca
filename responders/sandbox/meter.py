"""What all children of one job may cost the worker together: bytes it keeps of them, their processor time, their sleep.

Spent before anything is kept, so that the worker's own memory and time are bounded by it; what a single child may use
is ``running_child.py``'s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.errors import HostError, RobomarkError
from sim.recording import Verdict

#: What an object that is kept costs beside its text.
OBJECT_BYTES = 256
#: What each child may sleep before it counts: answers are not fetched in no time, least of all on a busy machine.
_FREE_SLEEP_SECONDS = 0.5


class ChildStopped(Exception):
    """A child that will say no more: why, in a sentence, and the line where that is known.

    It is one of the file that is run, or of ``file`` beside it.
    """

    def __init__(self, verdict: Verdict, message: str, line: int | None = None, file: str | None = None) -> None:
        super().__init__(message)
        self.verdict, self.message, self.line, self.file = verdict, message, line, file


@dataclass(frozen=True, slots=True)
class JobLimits:
    """For all trials of a job together: bytes kept, seconds of processor time, and seconds asleep in real time."""

    kept_bytes: int = 64 << 20
    cpu_seconds: float = 150.0
    sleep_seconds: float = 20.0


@dataclass(frozen=True, slots=True)
class Spent:
    """What a job has cost so far."""

    kept_bytes: int = 0
    cpu_seconds: float = 0.0
    sleep_seconds: float = 0.0


class JobMeter:
    """Counts what one job costs. ``heartbeat`` is called several times a second and may raise to end the job."""

    def __init__(self, limits: JobLimits = JobLimits(), heartbeat: Callable[[], None] = lambda: None) -> None:
        self._limits = limits
        self._heartbeat = heartbeat
        self._kept = 0
        self._cpu = self._sleep = 0.0  # of children that are gone

    @property
    def spent(self) -> Spent:
        """What the job has cost so far; seconds are counted of children that are gone."""
        return Spent(self._kept, self._cpu, self._sleep)

    @property
    def limits(self) -> JobLimits:
        """What the job may cost."""
        return self._limits

    def extend(self, limits: JobLimits) -> None:
        """Let the job cost this much from now on; what it has cost is kept."""
        self._limits = limits

    def heartbeat(self) -> None:
        """Whatever it raises that is not ours to tell a user is the machine's fault, never a child's."""
        try:
            self._heartbeat()
        except RobomarkError:
            raise
        except Exception as error:
            raise HostError(f"the job's heartbeat failed: {type(error).__name__}: {error}") from error

    def keep(self, size: int) -> None:
        """Pay for an object with ``size`` bytes of text, before it is kept. Raises ChildStopped."""
        self._kept += size + OBJECT_BYTES
        if self._kept > self._limits.kept_bytes:
            raise ChildStopped(
                Verdict.OUTPUT_LIMIT,
                f"all trials together said more than {self._limits.kept_bytes >> 20} MB, counting messages and images",
            )

    def check_cpu(self, running: float) -> None:
        """``running`` is what a child has used so far that is still there. Raises ChildStopped."""
        if self._cpu + running > self._limits.cpu_seconds:
            raise ChildStopped(
                Verdict.CPU_LIMIT,
                "all trials together computed for longer than a submission may",
            )

    def check_sleep(self, running: float) -> None:
        """``running`` is how long such a child has slept. Raises ChildStopped."""
        if self._sleep + max(0.0, running - _FREE_SLEEP_SECONDS) > self._limits.sleep_seconds:
            raise ChildStopped(
                Verdict.STALLED,
                f"all trials together slept for more than {self._limits.sleep_seconds:g} seconds of real time",
            )

    def child_ended(self, cpu_seconds: float, sleep_seconds: float) -> None:
        """Count the seconds of a child that is gone; the first ones asleep are free."""
        self._cpu += cpu_seconds
        self._sleep += max(0.0, sleep_seconds - _FREE_SLEEP_SECONDS)

    def give_back(self, before: Spent) -> None:
        """Forget what was spent since ``before``: the machine, not the submission, is why it was for nothing."""
        self._kept, self._cpu, self._sleep = before.kept_bytes, before.cpu_seconds, before.sleep_seconds
