"""Additional parts of an assignment: agents (the ``[agents]`` table) and a second robot.

``schema.py`` validates single tables; ``assignment_parts.py`` checks the remaining relations.
"""

from __future__ import annotations

import builtins
import keyword
import re
from collections.abc import Mapping, Sequence

from sim.errors import UsageError
from sim.recording import Pose
from submissions.assignment.problems import Path as Place
from submissions.assignment.problems import Problems, filter_tables
from submissions.assignment.scenario import Scenario
from submissions.assignment.schema import PartsTable, RerunsTable, ScenarioTable, WorldTable
from submissions.source_text import decode_source

#: Value of ``second_program``: the second robot runs the program of the first.
SAME = "same"
_MAX_AGENTS = 8
_NAME = re.compile(r"[a-z][a-z0-9_]{0,19}")
#: Names that a responder already uses, or that reports use with another meaning.
_RESERVED_NAMES = frozenset({"robot", "program", "responder", "bridge", "host", "assignment", "msg", "eds"})


def read_agents(
    document: Mapping[str, object], parts: PartsTable | None, files: Mapping[str, bytes], problems: Problems
) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return the source of each agent by name, and the texts of the files given here. Add mistakes to ``problems``."""
    table = document.get("agents", {})
    if not isinstance(table, dict):
        problems.add(("agents",), 'agents is not a table, expected [agents] and lines like parser = "student"')
        return {}, {}
    if table and parts is not None:
        _check_parts(table, parts, problems)
    givers: dict[str, str] = {}
    sources: dict[str, str] = {}
    for name, giver in sorted(table.items()):
        key_path = ("agents", name)
        if not _NAME.fullmatch(name) or name in _RESERVED_NAMES or keyword.iskeyword(name) or hasattr(builtins, name):
            problems.add(key_path, f'"{name[:60]}" cannot be the name of an agent, expected one like parser or logger')
        elif giver != "student" and (not isinstance(giver, str) or giver not in files or not giver.endswith(".py")):
            description = f'"{giver[:60]}"' if isinstance(giver, str) else "no text"
            problems.add(key_path, f'{name} is {description}, expected "student" or a .py file beside this file')
        else:
            givers[name] = giver
            if giver != "student":
                sources |= _read_source(giver, files, key_path, problems)
    return givers, sources


def _check_parts(table: Mapping[str, object], parts: PartsTable, problems: Problems) -> None:
    if len(table) > _MAX_AGENTS:
        problems.add(("agents",), f"agents has {len(table)} names, expected at most {_MAX_AGENTS}")
    if parts.responder == "none" or parts.program == "none":
        problems.add(("agents",), "agents needs a robot with a responder, expected both in [parts]")
    elif "student" not in (parts.program, parts.responder):
        problems.add(
            ("agents",), 'agents needs robot.py or responder.py from the student, expected one of them as "student"'
        )


def _read_source(
    name: str, files: Mapping[str, bytes], key_path: tuple[str, str], problems: Problems
) -> dict[str, str]:
    try:
        return {name: decode_source(files[name], name).text}
    except UsageError as error:
        problems.add(key_path, str(error).rstrip("."))
        return {}


def check_robots(document: Mapping[str, object], world: WorldTable, parts: PartsTable, problems: Problems) -> None:
    """Report missing programs or start poses of a robot, and settings for a robot that does not exist."""
    scenarios = list(filter_tables(document.get("scenario")))
    is_linked = world.robots == 2 and parts.responder == "none"
    for number, raw in enumerate(scenarios):
        channel = raw.get("channel")
        link = channel.get("link") if isinstance(channel, dict) else None
        if link == "between robots" and not is_linked:
            sentence = 'link is "between robots", expected robots = 2 in world and responder = "none" in parts with it'
            problems.add(("scenario", number, "channel", "link"), sentence)
        if link == "infrared" and is_linked:
            sentence = 'link is "infrared", to a beacon, but the robots talk to each other, expected "between robots"'
            problems.add(("scenario", number, "channel", "link"), sentence)
    if world.robots == 1:
        if "second_program" in parts.model_fields_set:
            problems.add(("parts", "second_program"), "second_program is given, expected robots = 2 in world with it")
        for number, raw in enumerate(scenarios):
            if "second_poses" in raw:
                sentence = "second_poses is given, expected robots = 2 in world with it"
                problems.add(("scenario", number, "second_poses"), sentence)
        return
    if "agents" in document:
        problems.add(("world", "robots"), "robots is 2, but agents are asked for one robot alone, expected robots = 1")
    if "training" in document:
        problems.add(("world", "robots"), "robots is 2, but a trained model answers no robot, expected robots = 1")
    for number, raw in enumerate(scenarios):
        if "second_poses" not in raw:
            problems.add(("scenario", number), "second_poses is missing, expected where the second robot starts")


def check_reruns(
    reruns: RerunsTable,
    parts: PartsTable,
    robots: int,
    agents: Mapping[str, str],
    scenarios: Sequence[Scenario | None],
    problems: Problems,
) -> None:
    """Report halves of a submission with only one part, and hidden causes without a hidden scenario."""
    sources = [parts.program, parts.responder, *agents.values()]
    # Without a second robot, the default of its program means nothing.
    sources += [parts.second_program] if robots == 2 else []
    if reruns.halves and sources.count("student") < 2:
        sentence = "halves is true, but students write one part, expected it with two parts from the student"
        problems.add(("reruns", "halves"), sentence)
    if reruns.reveals and all(each is None or each.visibility == "visible" for each in scenarios):
        sentence = f"reveals is {reruns.reveals}, but every scenario is visible, expected a hidden scenario with it"
        problems.add(("reruns", "reveals"), sentence)


def build_second_poses(table: ScenarioTable, poses: int, table_path: Place, problems: Problems) -> tuple[Pose, ...]:
    """Return the second robot's start pose for each pose of the first. A single pose applies to all."""
    second_poses = tuple(Pose(*pose) for pose in table.second_poses)
    if len(second_poses) == 1:
        return second_poses * poses
    if second_poses and len(second_poses) != poses:
        problems.add(
            (*table_path, "second_poses"),
            f"second_poses has {len(second_poses)} poses, expected one, or {poses} as poses has",
        )
        return ()
    return second_poses
