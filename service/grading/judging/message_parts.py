"""Parts of messages for students: quotes, places, faults, and why a run ended early.

The modules of the families write the messages themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from service.grading.grade import TrialResult
from service.grading.judging.outcome import Outcome, find_ending_fault
from service.language import translatable
from sim.recording import Fault, Verdict
from sim.sentences import Sentence, find_opening, iterate_values, join_sentences

_MAX_QUOTE_LENGTH = 80
_LINE = translatable("line %(line)s of %(name)s")
#: The sentence about a criterion that gives no marks because of another one, whose title it has.
WITHHELD_MARKS = translatable('This gives no marks, because "%(title)s" has less than half of its marks.')


def quote_text(text: str) -> str:
    """Return a student's text for use in a sentence: in quotes, on one line, shortened."""
    line = " ".join(text.split())
    return f'"{line}"' if len(line) <= _MAX_QUOTE_LENGTH else f'"{line[: _MAX_QUOTE_LENGTH - 3]}..."'


def quote_list(texts: tuple[str, ...], conjunction: Literal["and", "or"] = "and") -> str:
    """Return a list such as ``"a", "b" and "c"``."""
    *first_quotes, last_quote = [quote_text(text) for text in texts]
    if not first_quotes:
        return last_quote
    these = ", ".join(first_quotes)
    if conjunction == "or":
        return Sentence("%(these)s or %(last)s", these=these, last=last_quote)
    return Sentence("%(these)s and %(last)s", these=these, last=last_quote)


def describe_fault(fault: Fault) -> str:
    """Return a fault as ``NameError: name 'x' is not defined (line 3)``."""
    position = f" ({fault.place})" if fault.place else ""
    return f"{fault.message.rstrip('.')}{position}"


def states_fault(message: str, fault: Fault) -> bool:
    """Return whether a message contains the description of the fault."""
    return ("fault", describe_fault(fault)) in iterate_values(message)


def describe_line(name: str, line: int) -> Sentence:
    """Return a line of a file or cell as ``line 3 of robot.py``."""
    return Sentence(_LINE, line=line, name=name)


def find_line(message: str) -> tuple[str, int] | None:
    """Return the name of the file or cell and the line with which a message begins; None if it begins otherwise."""
    place = find_opening(message, _LINE)
    line = None if place is None else place.values["line"]
    return (str(place.values["name"]), line) if place is not None and isinstance(line, int) else None


def describe_place(trial: TrialResult, t: float | None) -> str:
    """Return a place as ``In scenario line, from (100, 800) facing 0°, with light noise 32, at 3.00 s``."""
    start = trial.recording.start
    x, y, heading = (f"{round(value, 1):g}" for value in (start.x, start.y, start.heading))
    place: str = Sentence(
        "In scenario %(scenario)s, from (%(x)s, %(y)s) facing %(heading)s°",
        scenario=trial.scenario,
        x=x,
        y=y,
        heading=heading,
    )
    if trial.light_noise:
        place = Sentence("%(place)s, with light noise %(level)g", place=place, level=trial.light_noise)
    if trial.motor_noise:
        place = Sentence("%(place)s, with motor noise %(level)g", place=place, level=trial.motor_noise)
    for condition, level in trial.sweep:
        if condition == "loss" and level:
            place = Sentence("%(place)s, with a message loss of %(level)g", place=place, level=level)
        if condition == "delay" and level:
            place = Sentence("%(place)s, with a message delay of %(level)g s", place=place, level=level)
    return place if t is None else Sentence("%(place)s, at %(seconds).2f s", place=place, seconds=t)


def add_place(place: str, message: str) -> str:
    """Return a message with the place that it is about in front."""
    return Sentence("%(place)s: %(message)s", place=place, message=message)


def add_hidden_note(message: str) -> str:
    """Return the feedback on visible trials with a fixed note that hidden trials are marked as well."""
    if not message:
        return Sentence("Marked in trials that are not shown.")
    return join_sentences(message, Sentence("Trials that are not shown are marked as well."))


def describe_early_end(trial: TrialResult, outcome: Outcome | None = None) -> str:
    """Return why the run ended early; empty if it did not, or the outcome already says so."""
    fault = find_ending_fault(trial.recording)
    if fault is None or (outcome is not None and outcome.has_end_reason):
        return ""
    if fault.verdict is Verdict.TIME_LIMIT:
        return Sentence("The program was still running when time ran out, at %(seconds)g s.", seconds=fault.t)
    return Sentence("The run ended early, at %(seconds).2f s.", seconds=fault.t)


def join_with_or(parts: Sequence[str]) -> str:
    """Join the parts with "or"; empty for no parts."""
    return _join(translatable("%(these)s or %(last)s"), parts)


def join_with_commas(parts: Sequence[str]) -> str:
    """Join the parts with commas; empty for no parts."""
    return _join(translatable("%(these)s, %(last)s"), parts)


def join_with_semicolons(parts: Sequence[str]) -> str:
    """Join the parts with semicolons; empty for no parts."""
    return _join(translatable("%(these)s; %(last)s"), parts)


def _join(template: str, parts: Sequence[str]) -> str:
    if len(parts) < 2:
        return parts[0] if parts else ""
    # Halves, because sentences must not be nested as deeply as a list is long.
    middle = len(parts) // 2
    return Sentence(template, these=_join(template, parts[:middle]), last=_join(template, parts[middle:]))
