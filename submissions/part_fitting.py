"""Adaptation of a submission to the parts that an assignment asks for: what is left out, what is missing.

``bundle.py`` reads the submitted files first.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from responders.source_file import SourceFile
from sim.errors import UsageError
from sim.sentences import Sentence, join_with_and
from submissions.file_kinds import advise_on_names
from submissions.marked_run import find_run, find_runs
from submissions.part_notes import PART_WORDS, build_missing_part_note, build_part_use_note
from submissions.raw_files import sanitise_name
from submissions.submission import PART_FILES, PARTS_BY_FILE, SECOND_PROGRAM, Notebook, Part, Submission, find_agent

if TYPE_CHECKING:
    from submissions.assignment.definition import Parts

_WRITEFILE = re.compile(r"\s*%%(?:writefile|file)[ \t]+(?P<name>[A-Za-z0-9_.]+)[ \t]*\n")


def fit_parts(submission: Submission, required_parts: Parts, *, source_name: str | None = None) -> Submission:
    """Adapt the submission to an assignment with these parts.

    A single file with another name than robot.py or responder.py becomes the one part that is asked for. Parts that the
    assignment provides or does not use are omitted with a note. If one of two parts is missing, a note says so.

    Raises:
        UsageError: None of the parts is present.
    """
    source_name = source_name or submission.student
    if submission.notebook is not None:
        return _fit_notebook(submission, submission.notebook, required_parts, source_name)
    submission = _add_agents(submission, required_parts, source_name)
    notes = list(submission.notes)
    parts: dict[Part, SourceFile | None] = {"program": submission.program, "responder": submission.responder}
    givers: dict[Part, str] = {"program": required_parts.program, "responder": required_parts.responder}
    student_parts = [part for part, who in givers.items() if who == "student"]
    submitted_parts = [part for part, source in parts.items() if source is not None]
    if len(student_parts) == 1 and len(submitted_parts) == 1 and student_parts != submitted_parts:
        only_source = parts[submitted_parts[0]]
        if only_source is not None and only_source.name.lower() not in PARTS_BY_FILE:
            parts = {submitted_parts[0]: None, student_parts[0]: only_source}
            notes = [note for note in notes if note != build_part_use_note(only_source.name, submitted_parts[0])]
            notes.append(build_part_use_note(only_source.name, student_parts[0]))
    missing_parts = [part for part in student_parts if parts.get(part) is None]
    files = [PART_FILES[part] for part in missing_parts]
    needed_files = [_describe_file(PART_FILES[part], PART_WORDS[part]) for part in student_parts]
    if required_parts.second_program == "student":
        needed_files.append(_describe_file(SECOND_PROGRAM, Sentence("the second robot's program")))
        files += [SECOND_PROGRAM] if SECOND_PROGRAM not in submission.files else []
    # With two robots, both programs are needed.
    if files and (len(missing_parts) == len(student_parts) or required_parts.second_program != "none"):
        raise UsageError(
            "%(where)s: has no %(names)s, expected %(expected)s%(renamed)s.",
            where=source_name,
            names=join_with_and(files),
            expected=join_with_and(needed_files),
            renamed=advise_on_names(missing_parts, submission.files),
        )
    notes += [build_missing_part_note(part, submission.files) for part in missing_parts]
    for part, source in parts.items():
        if source is not None and part not in student_parts:
            notes.append(f"{sanitise_name(source.name)} was left out: the assignment does not need {PART_WORDS[part]}.")
            parts[part] = None
    fitted_submission = dataclasses.replace(submission, program=parts.get("program"), responder=parts.get("responder"))
    notes += [f"{name} is empty." for name in find_empty_parts(fitted_submission)]
    return dataclasses.replace(fitted_submission, notes=tuple(notes))


def find_empty_parts(submission: Submission) -> Iterator[str]:
    """Yield the names of parts that contain only whitespace."""
    for code in (submission.program, submission.responder):
        if code is not None and not code.text.strip():
            yield sanitise_name(code.name)


def find_missing_part(submission: Submission, required_parts: Parts) -> Part | None:
    """Return the missing part if one of two was submitted; None if both or neither were."""
    if (required_parts.program, required_parts.responder) == ("student", "student"):
        if submission.program is None and submission.responder is not None:
            return "program"
        if submission.responder is None and submission.program is not None:
            return "responder"
    return None


def _fit_notebook(submission: Submission, notebook: Notebook, required_parts: Parts, source_name: str) -> Submission:
    """Keep the notebook if it is needed, otherwise the files beside it."""
    parts: dict[Part, SourceFile | None] = {"program": submission.program, "responder": submission.responder}
    givers: dict[Part, str] = {"program": required_parts.program, "responder": required_parts.responder}
    if all(parts[part] is not None for part, who in givers.items() if who == "student"):
        note = f"{sanitise_name(notebook.name)} was left out: the assignment needs the other files."
        notebook_submission = dataclasses.replace(submission, notebook=None, notes=(*submission.notes, note))
        return fit_parts(notebook_submission, required_parts, source_name=source_name)
    if required_parts.program == "student":
        find_run(notebook, required_parts.cell, submission.run)
    files, notes = dict(submission.files), list(submission.notes)
    for source in (submission.program, submission.responder):
        if source is not None:
            files[source.name] = source.text.encode("utf-8", "surrogatepass")
            notes.append(f"{sanitise_name(source.name)} is not used: the notebook is run instead.")
    if required_parts.program != "student" and find_runs(notebook):
        notes.append(f"{sanitise_name(notebook.name)}: the assignment provides the robot program.")
    notebook_submission = dataclasses.replace(
        submission,
        program=None,
        responder=None,
        files=MappingProxyType(dict(sorted(files.items()))),
        notes=tuple(notes),
    )
    return _add_agents(notebook_submission, required_parts, source_name)


def _add_agents(submission: Submission, required_parts: Parts, source_name: str) -> Submission:
    """Return the submission with each agent among its files, including agents first read as another part.

    A notebook can contain an agent in a cell that begins with ``%%writefile``.

    Raises:
        UsageError: An agent is missing.
    """
    if not required_parts.agents:
        return submission
    program, responder = submission.program, submission.responder
    files, notes = dict(submission.files), list(submission.notes)
    parts: dict[Part, SourceFile | None] = {"program": program, "responder": responder}
    for part, code in parts.items():
        if code is not None and find_agent(code.name, required_parts.agents):
            files[code.name] = code.text.encode("utf-8", "surrogatepass")
            notes = [note for note in notes if note != build_part_use_note(code.name, part)]
            program = None if part == "program" else program
            responder = None if part == "responder" else responder
    for name in [
        each
        for each in files
        if required_parts.agents.get(find_agent(each, required_parts.agents) or "", "student") != "student"
    ]:
        del files[name]
        notes.append(f"{sanitise_name(name)} was left out: the assignment provides this agent.")
    if submission.notebook is not None:
        files = _collect_written_agents(submission.notebook, required_parts.agents) | files
    present_agents = {find_agent(name, required_parts.agents) for name in files}
    missing_files = [
        f"{name}.py" for name, who in required_parts.agents.items() if who == "student" and name not in present_agents
    ]
    if missing_files and submission.notebook is not None:
        raise UsageError(
            "%(where)s: has no %(missing)s; put each agent in a file beside the notebook, or in a cell that begins "
            "with %%%%writefile %(first)s.",
            where=source_name,
            missing=join_with_and(missing_files),
            first=missing_files[0],
        )
    if missing_files:
        raise UsageError(
            "%(where)s: has no %(missing)s, expected a file for each agent.",
            where=source_name,
            missing=join_with_and(missing_files),
        )
    return dataclasses.replace(
        submission,
        program=program,
        responder=responder,
        files=MappingProxyType(dict(sorted(files.items()))),
        notes=tuple(notes),
    )


def _collect_written_agents(notebook: Notebook, agents: Mapping[str, str]) -> dict[str, bytes]:
    """Return the student's agents that cells of the notebook write to files."""
    agent_files = {}
    for cell in notebook.cells:
        match = _WRITEFILE.match(cell.source)
        if match is not None and agents.get(find_agent(match["name"], agents) or "") == "student":
            agent_files[match["name"]] = cell.source[match.end() :].encode("utf-8", "surrogatepass")
    return agent_files


def _describe_file(file: str, description: Sentence) -> Sentence:
    return Sentence("%(file)s (%(what)s)", file=file, what=description)
