"""Limits for student code: CPU time, memory and output of each process, and of all trials together.

The defaults apply to assignments without a ``[limits]`` table and to ``robomark run``.
"""

from __future__ import annotations

from dataclasses import dataclass

#: Maximum of the default of ``all_cpu``. It is less than the real time of a job, by default 900 s: a job that takes
#: longer counts as a fault of the machine, is repeated, and gets no marks.
_MAX_TOTAL_CPU = 600.0


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits for each child process of a trial (CPU seconds, MB, bytes of output), and for all trials together.

    The default of ``all_cpu`` allows ten trials at their limits and one second for each trial, up to ten minutes.
    """

    program_cpu: float = 5.0
    responder_cpu: float = 10.0
    program_memory_mb: int = 128
    responder_memory_mb: int = 512
    output_bytes: int = 1_000_000
    all_cpu: float | None = None
    all_sleep: float = 20.0  # seconds of real time in which processes are idle, after half a second for each
    all_output_mb: int = 64  # of stored data: texts, messages, images, calls

    def compute_total_cpu(self, trials: int) -> float:
        """Return the CPU seconds for ``trials`` trials together."""
        if self.all_cpu is not None:
            return self.all_cpu
        return min(10 * (self.program_cpu + self.responder_cpu) + trials, _MAX_TOTAL_CPU)


DEFAULT_LIMITS = Limits()
