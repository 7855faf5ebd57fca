"""Short labels for verdicts, as used in tables. Full sentences about verdicts are in ``reports.verdict_sentences``."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.language import translatable
from sim.recording import Verdict

#: Every verdict has a label.
VERDICT_LABELS: Mapping[Verdict, str] = MappingProxyType(
    {
        Verdict.FINISHED: translatable("completed"),
        Verdict.PROGRAM_ERROR: translatable("error in the robot program"),
        Verdict.RESPONDER_ERROR: translatable("error in the responder"),
        Verdict.PROTOCOL_ERROR: translatable("answer could not be read"),
        Verdict.TIME_LIMIT: translatable("still running at the end"),
        Verdict.CPU_LIMIT: translatable("computed for too long"),
        Verdict.MEMORY_LIMIT: translatable("used too much memory"),
        Verdict.OUTPUT_LIMIT: translatable("printed too much"),
        Verdict.STALLED: translatable("stopped responding"),
        Verdict.SANDBOX_VIOLATION: translatable("action not allowed"),
        Verdict.ASSIGNMENT_ERROR: translatable("error in the assignment"),
        Verdict.HOST_ERROR: translatable("grading failed"),
    }
)
