"""The files of a submission's agents: ``parser.py`` is the agent ``parser``, where an assignment has one of that name.

They lie among the files beside robot.py and responder.py; who asks them is no business of a submission.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from responders.code import Code
from sim.errors import UsageError
from sim.sentences import listed
from submissions.raw_files import shown
from submissions.source_text import decode_source
from submissions.submission import Notebook, Submission

if TYPE_CHECKING:
    from submissions.assignment.definition import Parts

_WRITEFILE = re.compile(r"\s*%%(?:writefile|file)[ \t]+(?P<name>[A-Za-z0-9_.]+)[ \t]*\n")


def with_agents(submission: Submission, asked: Parts, where: str) -> Submission:
    """The submission with each agent among its files, whatever it was taken for.

    A notebook can bring an agent in a cell that begins with ``%%writefile``. Raises UsageError if one is missing.
    """
    if not asked.agents:
        return submission
    program, responder = submission.program, submission.responder
    files, notes = dict(submission.files), list(submission.notes)
    for part in (program, responder):
        if part is not None and _agent_of(part.name, asked.agents):
            files[part.name] = part.text.encode("utf-8", "surrogatepass")
            notes = [note for note in notes if not note.startswith(f"{shown(part.name)} was taken for")]
            program = None if part is program else program
            responder = None if part is responder else responder
    for name in [
        each for each in files if asked.agents.get(_agent_of(each, asked.agents) or "", "student") != "student"
    ]:
        del files[name]
        notes.append(f"{shown(name)} was left out: the assignment brings that agent itself.")
    if submission.notebook is not None:
        files = _written_by_cells(submission.notebook, asked.agents) | files
    there = {_agent_of(name, asked.agents) for name in files}
    missing = [f"{name}.py" for name, who in asked.agents.items() if who == "student" and name not in there]
    if missing and submission.notebook is not None:
        raise UsageError(
            "%(where)s: has no %(missing)s; put each agent in a file beside the notebook, or in a cell that begins "
            "with %%%%writefile %(first)s.",
            where=where,
            missing=listed(missing),
            first=missing[0],
        )
    if missing:
        raise UsageError(
            "%(where)s: has no %(missing)s, expected a file for each agent.", where=where, missing=listed(missing)
        )
    return dataclasses.replace(
        submission,
        program=program,
        responder=responder,
        files=MappingProxyType(dict(sorted(files.items()))),
        notes=tuple(notes),
    )


def _written_by_cells(notebook: Notebook, agents: Mapping[str, str]) -> dict[str, bytes]:
    """The agents of the student that cells of the notebook write to files of their own."""
    written = {}
    for cell in notebook.cells:
        match = _WRITEFILE.match(cell.source)
        if match is not None and agents.get(_agent_of(match["name"], agents) or "") == "student":
            written[match["name"]] = cell.source[match.end() :].encode("utf-8", "surrogatepass")
    return written


def code_of(agent: str, files: Mapping[str, bytes]) -> Code | None:
    """The agent's file among those submitted. Raises UsageError if it cannot be read."""
    for name, data in files.items():
        if _agent_of(name, (agent,)):
            return Code(name, decode_source(data, shown(name)).text)
    return None


def without_agents(files: Mapping[str, bytes], agents: Iterable[str]) -> Mapping[str, bytes]:
    """All other files: what one agent is made of, no other process can read."""
    return {name: data for name, data in files.items() if not _agent_of(name, agents)}


def _agent_of(file: str, agents: Iterable[str]) -> str | None:
    return next((name for name in agents if file.lower() == f"{name}.py"), None)
