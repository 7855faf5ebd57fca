"""The faults of a grade's trials, with equal faults grouped and the student's source lines.

Faults are reported, not judged. Marks don't depend on this module.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.language import ENGLISH, Language, translatable
from service.reports.display_text import to_display_text, to_one_line
from service.reports.verdict_sentences import format_trial_name
from sim.errors import UsageError
from sim.recording import Fault, Verdict
from sim.recording_values import collect_faults
from submissions.source_text import find_magic_line
from submissions.submission import PART_FILES, SECOND_PROGRAM, Submission

_PARTY_TITLES: Mapping[str, str] = MappingProxyType(
    {
        "program": translatable("Robot program"),
        "second program": translatable("Program of the second robot"),
        "responder": translatable("Responder"),
        "bridge": translatable("Bridge"),
        "host": translatable("Grading machine"),
        "assignment": translatable("Assignment"),
    }
)
_PARTY_FILES: Mapping[str, str] = MappingProxyType(
    {"program": PART_FILES["program"], "second program": SECOND_PROGRAM, "responder": PART_FILES["responder"]}
)


@dataclass(frozen=True, slots=True)
class SourceLine:
    """One line of the student's file. ``marked`` is the line of the fault; the others are its context."""

    number: int
    text: str
    marked: bool


@dataclass(frozen=True, slots=True)
class FaultGroup:
    """One fault and its frequency. All texts are safe to show.

    ``file`` and ``line`` are its place in the submitted files; empty and None if there is none.
    """

    verdict: Verdict
    where: str
    message: str
    hint: str
    how_often: str
    excerpt: tuple[SourceLine, ...] = ()
    file: str = ""
    line: int | None = None


def describe_other_faults(stated_fault: Fault | None, grade: Grade) -> Iterator[tuple[str, FaultGroup]]:
    """Yield each fault with its description, shortened to the place if it has the message of ``stated_fault``."""
    stated_message = "" if stated_fault is None else to_display_text(stated_fault.message, 600)
    for group in group_faults(grade, limit=10):
        yield (group.where if group.message == stated_message else f"{group.where}: {group.message}"), group


def group_faults(
    grade: Grade, submission: Submission | None = None, limit: int = 12, language: Language = ENGLISH
) -> tuple[FaultGroup, ...]:
    """Return at most ``limit`` different faults in order of first occurrence. Excerpts need a ``submission``."""
    occurrences: dict[tuple[str, str, str], list[tuple[int, Fault]]] = {}
    for index, trial in enumerate(grade.trials):
        for fault in collect_faults(trial.recording):
            occurrences.setdefault((fault.who, fault.message, fault.place), []).append((index, fault))
    return tuple(_build_group(grade, places, submission, language) for places in list(occurrences.values())[:limit])


def describe_place(fault: Fault, language: Language = ENGLISH) -> str:
    """Return the position in the student's text: ``cell 7, line 3``, ``line 3 of helper.py``; empty if unknown."""
    parts = [fault.agent] if fault.agent else []
    parts += [language.say("cell %(number)s", number=fault.cell)] if fault.cell is not None else []
    if fault.line is not None and fault.file:
        parts.append(language.say("line %(number)s of %(file)s", number=fault.line, file=fault.file))
    elif fault.line is not None:
        parts.append(language.say("line %(number)s", number=fault.line))
    return ", ".join(parts)


def _build_group(
    grade: Grade, occurrences: list[tuple[int, Fault]], submission: Submission | None, language: Language
) -> FaultGroup:
    index, fault = occurrences[0]
    source = _find_source(fault, submission)
    is_other_cell = source is not None and fault.cell is not None and find_magic_line(source.text) is None
    party_title = translatable("Notebook") if is_other_cell and fault.who == "program" else _PARTY_TITLES[fault.who]
    location = language.say("Agent %(name)s", name=fault.agent) if fault.agent else language.say(party_title)
    if source is not None and not fault.file:
        location += f" ({to_one_line(source.name, 60)})"
    position = describe_place(replace(fault, agent=""), language)
    if position:
        location += f", {position}"
    first_occurrence = language.say(
        "at %(seconds)s s in %(trial)s",
        seconds=f"{fault.t:.2f}",
        trial=format_trial_name(grade.trials[index], language),
    )
    frequency = language.say(
        "%(times)s times in %(trials)s of %(all)s trials, first %(first)s",
        times=len(occurrences),
        trials=len({trial_index for trial_index, _ in occurrences}),
        all=len(grade.trials),
        first=first_occurrence,
    )
    how_often = first_occurrence if len(occurrences) == 1 else frequency
    excerpt = () if source is None or fault.line is None else extract_excerpt(source, fault.line)
    return FaultGroup(
        fault.verdict,
        location,
        to_display_text(fault.message, 600),
        to_display_text(fault.hint, 600),
        how_often,
        excerpt,
        *_locate_in_files(fault),
    )


def _locate_in_files(fault: Fault) -> tuple[str, int | None]:
    """Return the name under which the fault's file is submitted, and its line; no place in a notebook's cells."""
    if fault.cell is not None or fault.line is None:
        return "", None
    agent_file = f"{fault.agent}.py" if fault.agent else ""
    return fault.file or agent_file or _PARTY_FILES.get(fault.who, ""), fault.line


def _find_source(fault: Fault, submission: Submission | None) -> SourceFile | None:
    if submission is None:
        return None
    if fault.file:
        return _find_file(fault.file, submission)
    if submission.notebook is not None and fault.cell is not None:
        cells = {cell.number: cell.source for cell in submission.notebook.cells}
        return SourceFile(submission.notebook.name, cells.get(fault.cell, ""))
    if fault.agent:
        return submission.find_agent_code(fault.agent)
    parts = {"program": submission.program, "responder": submission.responder}
    if fault.who == "second program":
        parts[fault.who] = submission.find_code(SECOND_PROGRAM)
    return parts.get(fault.who)


def find_named_source(name: str, submission: Submission) -> SourceFile | None:
    """Return the source that a hint names: ``cell 3``, a part, or a neighbouring file."""
    if name.startswith("cell ") and submission.notebook is not None:
        cells = {f"cell {cell.number}": cell.source for cell in submission.notebook.cells}
        return SourceFile(name, cells[name]) if name in cells else None
    parts = {PART_FILES["program"]: submission.program, PART_FILES["responder"]: submission.responder}
    return parts.get(name) or _find_file(name, submission)


def _find_file(file: str, submission: Submission) -> SourceFile | None:
    """Return the named file, or None. The name comes from student code, so it may be anything."""
    with contextlib.suppress(UsageError):
        return submission.find_code(file)
    return None


def extract_excerpt(source: SourceFile, line: int) -> tuple[SourceLine, ...]:
    """Return the line with two neighbours on each side; empty if the source has no such line."""
    lines = source.text.rstrip("\n").split("\n")
    if not 1 <= line <= len(lines):
        return ()
    first_line, last_line = max(1, line - 2), min(len(lines), line + 2)
    while first_line < line and not lines[first_line - 1].strip():
        first_line += 1
    return tuple(
        SourceLine(number, to_display_text(lines[number - 1].rstrip("\r"), 200), number == line)
        for number in range(first_line, last_line + 1)
    )
