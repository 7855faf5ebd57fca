"""The faults of a grade's trials, with equal faults grouped and the student's source lines.

Faults are reported, not judged. Marks don't depend on this module.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from responders.code import Code
from service.grading.grade import Grade
from service.language import ENGLISH, Language, translatable
from service.reports.readable import one_line, readable
from service.reports.verdict_sentences import trial_words
from sim.errors import UsageError
from sim.recorded import faults_of
from sim.recording import Fault, Verdict
from submissions.source_text import magic_place
from submissions.submission import PART_FILES, SECOND_PROGRAM, Submission

_WHERE: Mapping[str, str] = MappingProxyType(
    {
        "program": translatable("Robot program"),
        "second program": translatable("Program of the second robot"),
        "responder": translatable("Responder"),
        "bridge": translatable("Bridge"),
        "host": translatable("Grading machine"),
        "assignment": translatable("Assignment"),
    }
)


@dataclass(frozen=True, slots=True)
class SourceLine:
    """One line of the student's file. ``marked`` is the line of the fault; the others are its context."""

    number: int
    text: str
    marked: bool


@dataclass(frozen=True, slots=True)
class FaultGroup:
    """One fault and its frequency. All texts are safe to show."""

    verdict: Verdict
    where: str
    message: str
    hint: str
    how_often: str
    excerpt: tuple[SourceLine, ...] = ()


def faults_beside(cause: str, grade: Grade, submission: Submission | None = None) -> Iterator[tuple[str, FaultGroup]]:
    """Yield each fault with its description, shortened to the place if the cause already has its message."""
    for group in fault_groups(grade, submission, limit=10):
        told = group.message.rstrip(".") in cause
        yield (group.where if told else f"{group.where}: {group.message}"), group


def fault_groups(
    grade: Grade, submission: Submission | None = None, limit: int = 12, language: Language = ENGLISH
) -> tuple[FaultGroup, ...]:
    """Return at most ``limit`` different faults in order of first occurrence. Excerpts need a ``submission``."""
    found: dict[tuple[str, str, str], list[tuple[int, Fault]]] = {}
    for index, trial in enumerate(grade.trials):
        for fault in faults_of(trial.recording):
            found.setdefault((fault.who, fault.message, fault.place), []).append((index, fault))
    return tuple(_group(grade, places, submission, language) for places in list(found.values())[:limit])


def place_words(fault: Fault, language: Language = ENGLISH) -> str:
    """Return the position in the student's text: ``cell 7, line 3``, ``line 3 of helper.py``; empty if unknown."""
    within = [fault.agent] if fault.agent else []
    within += [language.say("cell %(number)s", number=fault.cell)] if fault.cell is not None else []
    if fault.line is not None and fault.file:
        within.append(language.say("line %(number)s of %(file)s", number=fault.line, file=fault.file))
    elif fault.line is not None:
        within.append(language.say("line %(number)s", number=fault.line))
    return ", ".join(within)


def _group(
    grade: Grade, places: list[tuple[int, Fault]], submission: Submission | None, language: Language
) -> FaultGroup:
    index, fault = places[0]
    source = _source(fault, submission)
    is_other_cell = source is not None and fault.cell is not None and magic_place(source.text) is None
    who = translatable("Notebook") if is_other_cell and fault.who == "program" else _WHERE[fault.who]
    where = language.say("Agent %(name)s", name=fault.agent) if fault.agent else language.say(who)
    if source is not None and not fault.file:
        where += f" ({one_line(source.name, 60)})"
    place = place_words(replace(fault, agent=""), language)
    if place:
        where += f", {place}"
    first = language.say(
        "at %(seconds)s s in %(trial)s", seconds=f"{fault.t:.2f}", trial=trial_words(grade.trials[index], language)
    )
    often = language.say(
        "%(times)s times in %(trials)s of %(all)s trials, first %(first)s",
        times=len(places),
        trials=len({trial_index for trial_index, _ in places}),
        all=len(grade.trials),
        first=first,
    )
    how_often = first if len(places) == 1 else often
    excerpt = () if source is None or fault.line is None else excerpt_around(source, fault.line)
    return FaultGroup(fault.verdict, where, readable(fault.message, 600), readable(fault.hint, 600), how_often, excerpt)


def _source(fault: Fault, submission: Submission | None) -> Code | None:
    if submission is None:
        return None
    if fault.file:
        return _beside(fault.file, submission)
    if submission.notebook is not None and fault.cell is not None:
        cells = {cell.number: cell.source for cell in submission.notebook.cells}
        return Code(submission.notebook.name, cells.get(fault.cell, ""))
    if fault.agent:
        return submission.agent(fault.agent)
    parts = {"program": submission.program, "responder": submission.responder}
    if fault.who == "second program":
        parts[fault.who] = submission.code(SECOND_PROGRAM)
    return parts.get(fault.who)


def source_called(name: str, submission: Submission) -> Code | None:
    """Return the source that a hint names: ``cell 3``, a part, or a neighbouring file."""
    if name.startswith("cell ") and submission.notebook is not None:
        cells = {f"cell {cell.number}": cell.source for cell in submission.notebook.cells}
        return Code(name, cells[name]) if name in cells else None
    parts = {PART_FILES["program"]: submission.program, PART_FILES["responder"]: submission.responder}
    return parts.get(name) or _beside(name, submission)


def _beside(file: str, submission: Submission) -> Code | None:
    """Return the named file, or None. The name comes from student code, so it may be anything."""
    with contextlib.suppress(UsageError):
        return submission.code(file)
    return None


def excerpt_around(source: Code, line: int, around: int = 2) -> tuple[SourceLine, ...]:
    """Return the line and its neighbours; empty if the source has no such line."""
    lines = source.text.rstrip("\n").split("\n")
    if not 1 <= line <= len(lines):
        return ()
    first, last = max(1, line - around), min(len(lines), line + around)
    while first < line and not lines[first - 1].strip():
        first += 1
    return tuple(
        SourceLine(number, readable(lines[number - 1].rstrip("\r"), 200), number == line)
        for number in range(first, last + 1)
    )
