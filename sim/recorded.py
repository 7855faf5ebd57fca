"""What belongs to a recording without being in it: the floor and the robot that it names, and where that robot was.

Whatever is drawn or judged of it is the service's.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from sim.recording import SECOND, STAND_IN, Fault, Line, Pose, Recording, Verdict
from sim.robot import ROBOTS, Robot

if TYPE_CHECKING:
    from sim.floors import Floor


def floor_of(recording: Recording) -> Floor | None:
    """The floor that was driven on; None for an image of an instructor's own, which is not kept with the recording."""
    # Whoever only reads what happened needs no floor, nor what draws them.
    from sim.floors import floor, names

    if recording.background not in names():
        return None
    return floor(recording.background, labels=recording.label_patches, seed=recording.sheet)


def robot_of(recording: Recording) -> Robot:
    """The robot that was driven; the default one if its name is not known any more."""
    return ROBOTS.get(recording.robot, ROBOTS["Default_Robot"])


def stood_still(recording: Recording) -> bool:
    """Whether no robot moved or turned in any tick; so too if there was none."""
    ticks, start = recording.ticks, recording.start
    # The heading has been radians in between.
    still = all(
        bool((abs(column - first) < 1e-9).all())
        for column, first in ((ticks.x, start.x), (ticks.y, start.y), (ticks.heading, start.heading))
    )
    return still and (recording.partner is None or stood_still(recording.partner))


def printed_alone(recording: Recording) -> list[Line]:
    """What one robot printed, without what ``say`` printed because it was said."""
    said = Counter((line.t, line.text) for line in recording.spoken)
    alone = []
    for line in recording.printed:
        if said[line.t, line.text]:
            said[line.t, line.text] -= 1
        else:
            alone.append(line)
    return alone


def without_responder(recording: Recording) -> bool:
    """Whether the simulator stood in for a responder, by what every answer is: the text itself, after one word."""
    messages = recording.messages
    answers = [each for each in messages if each.sender == "responder"]
    return bool(answers) and all(
        each.reply_to is not None and each.text == STAND_IN + messages[each.reply_to].received for each in answers
    )


def faults_of(recording: Recording) -> tuple[Fault, ...]:
    """The faults of all robots, the earliest first; of the same moment, the first robot's."""
    partners = recording.partner.faults if recording.partner is not None else ()
    return tuple(sorted((*recording.faults, *partners), key=lambda fault: fault.t))


def verdict_of(recording: Recording) -> Verdict:
    """How the trial ended: by the earliest fault of any robot."""
    if recording.partner is None:
        return recording.verdict
    return next((fault.verdict for fault in faults_of(recording)), Verdict.FINISHED)


def seconds_at(recording: Recording, tick: int) -> float:
    """When a tick was done."""
    return tick * recording.ticks.length / SECOND


def ticks_until(recording: Recording, t: float) -> int:
    """How many ticks were done at ``t`` seconds."""
    return int(t * recording.ticks.per_second + 1e-6)


def pose_after(recording: Recording, tick: int) -> Pose:
    """Where the robot was after that many ticks; at its start before the first, at its end from the last on."""
    ticks = recording.ticks
    done = min(tick, len(ticks))
    if done < 1:
        return recording.start
    return Pose(float(ticks.x[done - 1]), float(ticks.y[done - 1]), float(ticks.heading[done - 1]))


def pose_at(recording: Recording, t: float) -> Pose:
    """Where the robot was at ``t`` seconds: its pose after the last tick until then."""
    return pose_after(recording, ticks_until(recording, t))
