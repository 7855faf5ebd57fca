"""Parts of messages for students: quotes, places, faults, and why a run ended early.

The modules of the families write the messages themselves.
"""

from __future__ import annotations

from service.grading.grade import TrialResult
from service.grading.judging.outcome import Outcome, find_ending_fault
from sim.recording import Fault, Verdict
from submissions.sweep import CONDITIONS

_MAX_QUOTE_LENGTH = 80


def quote_text(text: str) -> str:
    """Return a student's text for use in a sentence: in quotes, on one line, shortened."""
    line = " ".join(text.split())
    return f'"{line}"' if len(line) <= _MAX_QUOTE_LENGTH else f'"{line[: _MAX_QUOTE_LENGTH - 3]}..."'


def quote_list(texts: tuple[str, ...], conjunction: str = "and") -> str:
    """Return a list such as ``"a", "b" and "c"``."""
    quotes = [quote_text(text) for text in texts]
    return quotes[0] if len(quotes) == 1 else f"{', '.join(quotes[:-1])} {conjunction} {quotes[-1]}"


def describe_fault(fault: Fault) -> str:
    """Return a fault as ``NameError: name 'x' is not defined (line 3)``."""
    position = f" ({fault.place})" if fault.place else ""
    return f"{fault.message.rstrip('.')}{position}"


def describe_place(trial: TrialResult, t: float | None) -> str:
    """Return a place as ``In scenario line, from (100, 800) facing 0°, with light noise 32, at 3.00 s``."""
    start = trial.recording.start
    x, y, heading = (f"{round(value, 1):g}" for value in (start.x, start.y, start.heading))
    clauses = [f"In scenario {trial.scenario}, from ({x}, {y}) facing {heading}°"]
    if trial.light_noise:
        clauses.append(f"with light noise {trial.light_noise:g}")
    if trial.motor_noise:
        clauses.append(f"with motor noise {trial.motor_noise:g}")
    for condition, level in trial.sweep:
        if condition in ("loss", "delay") and level:
            condition_info = CONDITIONS[condition]
            clauses.append(
                f"with a {condition_info.words} of {level:g}"
                + (f" {condition_info.unit}" if condition == "delay" else "")
            )
    if t is not None:
        clauses.append(f"at {t:.2f} s")
    return ", ".join(clauses)


def add_hidden_note(message: str) -> str:
    """Return the feedback on visible trials with a fixed note that hidden trials are marked as well."""
    return (
        f"{message} Trials that are not shown are marked as well."
        if message
        else "Marked in trials that are not shown."
    )


def describe_early_end(trial: TrialResult, outcome: Outcome | None = None) -> str:
    """Return why the run ended early; empty if it did not, or the outcome already says so."""
    fault = find_ending_fault(trial.recording)
    if fault is None or (outcome is not None and outcome.has_end_reason):
        return ""
    if fault.verdict is Verdict.TIME_LIMIT:
        return f" The program was still running when time ran out, at {fault.t:g} s."
    return f" The run ended early, at {fault.t:.2f} s."
