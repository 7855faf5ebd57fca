"""The specs of the parts that take part in a run: their code, files, flags and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import ProgramSpec, ResponderSpec
from sim.errors import UsageError
from sim.sentences import Sentence
from submissions.assignment.definition import Assignment
from submissions.criteria.code import SourceRules
from submissions.magics import Flags, comment_out_magic, split_program
from submissions.simulator_page import apply_flags
from submissions.source_text import find_modules
from submissions.submission import Part, Submission

_MEGABYTE = 1 << 20


def choose_code(
    part_name: str, file_name: str, source: str, submitted_code: SourceFile | None, assignment: Assignment
) -> SourceFile | None:
    """Return the code of a part from its ``source`` in the assignment; None for a part that does not exist.

    Raises:
        UsageError: The part was not submitted.
    """
    if source == "none":
        return None
    if source != "student":
        return SourceFile(source, assignment.given_parts[source])
    if submitted_code is None:
        raise UsageError(f"the submission has no {part_name}; {assignment.id} requires {file_name}")
    return submitted_code


@dataclass(frozen=True, slots=True)
class ProgramHead:
    """A program's flags, its text after the magic line, notes on both, and why that line is ignored, if it is."""

    flags: Flags
    text: str
    notes: tuple[str, ...]
    ignored: str = ""


def read_head(text: str, assignment: Assignment) -> ProgramHead:
    """Parse a program's magic line. Notes say where the assignment overrides it."""
    try:
        flags, text = split_program(text)
        settings = apply_flags(flags)
    except UsageError as error:
        note = Sentence("the program's magic line is ignored: %(error)s", error=error.message)
        return ProgramHead(Flags(), comment_out_magic(text), (note,), error.message)
    world = assignment.world
    notes: list[str] = []
    if "b" in flags.values and settings.background != world.background:
        background = flags.values["b"][:40]
        notes.append(
            Sentence(
                "the program selects the floor %(floor)s, but the assignment uses %(expected)s",
                floor=background,
                expected=world.background,
            )
        )
    if "r" in flags.values and settings.robot != world.robot:
        notes.append(
            Sentence(
                "the program selects the robot %(robot)s, but the assignment uses %(expected)s",
                robot=settings.robot,
                expected=world.robot,
            )
        )
    if flags.values.keys() & {"N", "M"}:
        notes.append(Sentence("the assignment's noise is used, not the program's -N or -M"))
    return ProgramHead(flags, text, tuple(notes))


def collect_files(submission: Submission, assignment: Assignment, source: str) -> Mapping[str, bytes]:
    """Return the files in the folder of a part of ``source``. Submitted files override given ones.

    Parts from the assignment cannot import the submission's code.
    """
    submitted_files = submission.files_without(assignment.parts.agents)
    own_files = (each for each in submitted_files.items() if source == "student" or not each[0].endswith(".py"))
    return {**assignment.given, **dict(own_files)}


def build_program_spec(
    code: SourceFile, flags: Flags, files: Mapping[str, bytes], assignment: Assignment
) -> ProgramSpec:
    """Return the spec of a robot program, with the modules that it imports from ``files``."""
    limits = assignment.limits
    child_limits = ChildLimits(
        limits.program_cpu, limits.program_memory_mb * _MEGABYTE, _collect_avoided_modules(assignment, "program")
    )
    return ProgramSpec(code, flags.preamble, child_limits, limits.output_bytes, find_modules(code.text, files.get))


def build_responder_spec(
    code: SourceFile | None, files: Mapping[str, bytes], assignment: Assignment
) -> ResponderSpec | None:
    """Return the spec of a responder or agent; None without code."""
    if code is None:
        return None
    limits = assignment.limits
    avoided_modules = _collect_avoided_modules(assignment, "responder")
    child_limits = ChildLimits(limits.responder_cpu, limits.responder_memory_mb * _MEGABYTE, avoided_modules)
    return ResponderSpec(code, files, child_limits, limits.output_bytes)


def _collect_avoided_modules(assignment: Assignment, part: Part) -> tuple[str, ...]:
    """Return the modules that a student's part may not import. Marked import rules are also enforced at run time."""
    if getattr(assignment.parts, part) != "student":
        return ()
    rules = (each for each in assignment.criteria if isinstance(each, SourceRules) and each.part == part and each.marks)
    return tuple(sorted({module for each in rules for module in each.avoided_modules}))
