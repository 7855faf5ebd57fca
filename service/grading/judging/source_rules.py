"""Judging what the text of a submission has: its constructs, calls, names and flags, as it was read in the sandbox.

What the code does when it runs is judged elsewhere, but for one thing that needs no text: a robot that spoke has said
something.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from fractions import Fraction
from typing import Any

from service.grading.grade import TrialResult
from service.grading.judging.outcome import Outcome, failed, passed
from submissions.criteria.code import CONSTRUCTS, SourceRules, flags_in
from submissions.magics import Flags

#: What makes the robot speak.
SPEECH = ("say()", "speak()")
#: More that is wrong would give_up the first.
_MOST_TOLD = 4
_UNREADABLE = "it cannot be read"


@dataclass(frozen=True, slots=True)
class SourcePlace:
    """A file beside the part, or a cell of a notebook (empty: the part itself), and a line."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"line {self.line} of {self.file}" if self.file else f"line {self.line}"


@dataclass(frozen=True, slots=True)
class SourceAnswers:
    """Where a part has what each rule of a criterion names, in the order of the rules; None where it has it not.

    ``error``: why it cannot be read. ``unread``: a file beside it that cannot be, and why. ``doubts`` are places that
    can do more than their text shows.
    """

    uses: tuple[SourcePlace | None, ...] = ()
    avoids: tuple[SourcePlace | None, ...] = ()
    in_loop: tuple[SourcePlace | None, ...] = ()
    defines: tuple[SourcePlace | None, ...] = ()
    speech: tuple[SourcePlace | None, ...] = ()
    doubts: tuple[str, ...] = ()
    error: str = ""
    unread: str = ""

    @classmethod
    def read(cls, told: Any, criterion: SourceRules) -> SourceAnswers:
        """From what the reader in the sandbox returned, which is not believed to have any form."""
        try:
            name, why, line = told["unread"] or ("", "", None)
            where = f" (line {int(line)})" if line is not None else ""
            answers = (
                _places(told["uses"], criterion.uses),
                _places(told["avoids"], criterion.avoids),
                _places(told["in_loop"], criterion.in_loop),
                _places(told["defines"], criterion.defines),
                _places(told["shown"], SPEECH),
            )
            doubts = tuple(f"{_place(file, line)} has {str(what)[:80]}" for file, line, what in told["doubts"])
        except (LookupError, TypeError, ValueError, OverflowError):
            return cls(error=_UNREADABLE)
        if why and not name:
            return cls(error=f"{str(why)[:200]}{where}")
        return cls(*answers, doubts, "", f"{str(name)[:60]} cannot be read: {str(why)[:200]}" if name else "")


def judge_source(
    criterion: SourceRules, answers: SourceAnswers | None, flags: Flags, trials: Sequence[TrialResult] = ()
) -> Outcome:
    """``trials`` are those that the program was driven in."""
    whose = "your program" if criterion.part == "program" else "your responder"
    if answers is None:
        return failed(f"Expected {whose} to be submitted, but it was not.")
    if answers.error:
        return failed(f"Expected {whose} to be readable as Python, but: {answers.error}.")
    wrong: list[str] = []
    for rule, place in zip(criterion.uses, answers.uses, strict=True):
        if place is None:
            wrong.append(f"Expected {whose} to use {_words(rule)}, but it does not, or not where it is run")
    for rule, place in zip(criterion.avoids, answers.avoids, strict=True):
        but = f"{place} has it" if place is not None else _spoke(rule, answers, trials) or answers.unread
        if but:
            wrong.append(f"Expected {whose} to do without {_words(rule)}, but {but}")
    for rule, place in zip(criterion.in_loop, answers.in_loop, strict=True):
        if place is None:
            wrong.append(f"Expected {whose} to call {rule} inside a loop, but it does not, or not where it is run")
    for rule, place in zip(criterion.defines, answers.defines, strict=True):
        if place is None:
            wrong.append(f"Expected {whose} to define a function {rule}, but it does not")
    asked = _missing_flags(criterion, flags)
    wrong += [f"Expected the magic line of {whose} to have {told}, but it does not" for told in asked if told]
    for_staff = _for_staff(criterion, answers)
    if not wrong:
        return passed(f"The text of {whose} is as expected.", for_staff=for_staff)
    count = len(criterion.uses + criterion.avoids + criterion.in_loop + criterion.defines) + len(asked)
    message = f"{'. '.join(wrong[:_MOST_TOLD])}."
    return failed(message, score=Fraction(count - len(wrong), count), for_staff=for_staff)


def _spoke(rule: str, answers: SourceAnswers, trials: Sequence[TrialResult]) -> str:
    """That the robot spoke although the text shows no call that does it; a rule may mean one and not the other."""
    meant = [fnmatchcase(call, rule) for call in SPEECH]
    shown = any(place is not None for place in answers.speech)
    if not rule.endswith("()") or not any(meant) or shown:
        return ""
    spoke = any(trial.recording.spoken for trial in trials if trial.visibility == "visible")
    return "the robot spoke when it was run" if spoke else ""


def _for_staff(criterion: SourceRules, answers: SourceAnswers) -> str:
    """Where to look for what is avoided, as its text does not show all that it can do."""
    if not criterion.avoids or not answers.doubts:
        return ""
    return f"Can do more than its text shows: {'; '.join(answers.doubts)}."


def _missing_flags(criterion: SourceRules, flags: Flags) -> list[str]:
    """For each flag that is asked for the flag if it is missing, else nothing."""
    if not criterion.flags:
        return []
    wanted = flags_in(criterion.flags)
    values = [
        "" if flags.values.get(short) == value else f"-{short} {value}"
        for short, value in sorted(wanted.values.items())
    ]
    return values + ["" if short in flags.switches else f"-{short}" for short in sorted(wanted.switches)]


def _words(rule: str) -> str:
    if rule not in CONSTRUCTS:
        return rule
    return f"a {rule} loop" if rule in ("for", "while") else rule


def _places(told: Any, rules: Sequence[str]) -> tuple[SourcePlace | None, ...]:
    """Raises one of Python's errors for what is no answer to each of the rules."""
    return tuple(None if place is None else _place(*place) for _, place in zip(rules, told, strict=True))


def _place(file: Any, line: Any) -> SourcePlace:
    return SourcePlace(str(file)[:60], int(line))
