"""The ``[agents]`` table of an assignment: which agents the responder may ask, and who gives the file of each.

What an agent is sent and answers is no business of an assignment's file; criteria look at that.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections.abc import Mapping

from sim.errors import UsageError
from submissions.assignment.problems import Problems
from submissions.assignment.schema import PartsTable
from submissions.source_text import decode_source

_MOST = 8
_NAME = re.compile(r"[a-z][a-z0-9_]{0,19}")
#: What a responder has under these names already, or a report calls otherwise.
_TAKEN = frozenset({"robot", "program", "responder", "bridge", "host", "assignment", "msg", "eds"})


def read_agents(
    document: Mapping[str, object], parts: PartsTable | None, files: Mapping[str, bytes], problems: Problems
) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Who gives each agent, by name, and the texts of the files given here; what is wrong goes into ``problems``."""
    table = document.get("agents", {})
    if not isinstance(table, dict):
        problems.add(("agents",), 'agents is no table, expected [agents] and lines like parser = "student"')
        return {}, {}
    if table and parts is not None:
        _check_parts(table, parts, problems)
    givers: dict[str, str] = {}
    sources: dict[str, str] = {}
    for name, who in sorted(table.items()):
        place = ("agents", name)
        if not _NAME.fullmatch(name) or name in _TAKEN or keyword.iskeyword(name) or hasattr(builtins, name):
            problems.add(place, f'"{name[:60]}" cannot be the name of an agent, expected one like parser or logger')
        elif who != "student" and (not isinstance(who, str) or who not in files or not who.endswith(".py")):
            shown = f'"{who[:60]}"' if isinstance(who, str) else "no text"
            problems.add(place, f'{name} is {shown}, expected "student" or a .py file beside this file')
        else:
            givers[name] = who
            if who != "student":
                sources |= _source(who, files, place, problems)
    return givers, sources


def _check_parts(table: Mapping[str, object], parts: PartsTable, problems: Problems) -> None:
    if len(table) > _MOST:
        problems.add(("agents",), f"agents has {len(table)} names, expected at most {_MOST}")
    if parts.responder == "none" or parts.program == "none":
        problems.add(("agents",), "agents are there and no robot with a responder, expected both in [parts]")
    elif "student" not in (parts.program, parts.responder):
        problems.add(
            ("agents",), 'agents are there and neither robot.py nor responder.py is "student", expected one of them'
        )


def _source(name: str, files: Mapping[str, bytes], place: tuple[str, str], problems: Problems) -> dict[str, str]:
    try:
        return {name: decode_source(files[name], name).text}
    except UsageError as error:
        problems.add(place, str(error).rstrip("."))
        return {}
