"""What an assignment with two robots has to say besides, and what only such a one may say.

What a single table may hold is ``schema.py``; the rest of what has to fit together is ``assignment_parts.py``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sim.recording import Pose

if TYPE_CHECKING:
    from submissions.assignment.problems import Problems
    from submissions.assignment.schema import PartsTable, ScenarioTable, WorldTable
    from submissions.assignment.toml_lines import Path as Place

#: As ``second_program``: what runs on the first robot runs on the second as well.
SAME = "same"


def check_robots(document: Mapping[str, object], world: WorldTable, parts: PartsTable, problems: Problems) -> None:
    """Each robot has a program and a place to start from, and nobody has those of a robot that is not there."""
    # With it come the schemas, which who only asks for the second robot's program does not need.
    from submissions.document import list_of_tables

    scenarios = list(list_of_tables(document.get("scenario")))
    linked = world.robots == 2 and parts.responder == "none"
    for number, raw in enumerate(scenarios):
        channel = raw.get("channel")
        link = channel.get("link") if isinstance(channel, dict) else None
        if link == "between robots" and not linked:
            sentence = 'link is "between robots", expected robots = 2 in world and responder = "none" in parts with it'
            problems.add(("scenario", number, "channel", "link"), sentence)
        if link == "infrared" and linked:
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
        problems.add(("world", "robots"), "robots is 2, but what is trained answers no robot, expected robots = 1")
    for number, raw in enumerate(scenarios):
        if "second_poses" not in raw:
            problems.add(("scenario", number), "second_poses is missing, expected where the second robot starts")


def second_poses_of(table: ScenarioTable, poses: int, place: Place, problems: Problems) -> tuple[Pose, ...]:
    """Where the second robot starts for each pose of the first; one is meant for all."""
    found = tuple(Pose(*pose) for pose in table.second_poses)
    if len(found) == 1:
        return found * poses
    if found and len(found) != poses:
        problems.add(
            (*place, "second_poses"), f"second_poses has {len(found)} poses, expected one, or {poses} as poses has"
        )
        return ()
    return found
