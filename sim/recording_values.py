"""Values derived from a recording: its floor and robot, the robot's pose at a time, faults and verdict.

Plots and judging are in ``service``.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from sim.recording import SECOND, STAND_IN_PREFIX, Fault, Pose, Recording, TimedText, Verdict
from sim.robot import ROBOTS, Robot

if TYPE_CHECKING:
    from sim.floors import Floor


def rebuild_floor(recording: Recording) -> Floor | None:
    """Return the floor of the recording; None for an instructor's own image, which is not stored with it."""
    # Imported here, because readers of plain values do not need the drawing code.
    from sim.floors import build_floor, list_floor_names

    if recording.background not in list_floor_names():
        return None
    return build_floor(recording.background, labels=recording.label_patches, seed=recording.sheet)


def get_recorded_robot(recording: Recording) -> Robot:
    """Return the robot of the recording, or the default robot if its name is unknown."""
    return ROBOTS.get(recording.robot, ROBOTS["Default_Robot"])


def is_stationary(recording: Recording) -> bool:
    """Return whether no robot moved or turned in any tick; True without ticks."""
    ticks, start = recording.ticks, recording.start
    # The conversion to radians and back loses the last bits.
    is_still = all(
        bool((abs(column - first) < 1e-9).all())
        for column, first in ((ticks.x, start.x), (ticks.y, start.y), (ticks.heading, start.heading))
    )
    return is_still and (recording.partner is None or is_stationary(recording.partner))


def collect_printed_lines(recording: Recording) -> list[TimedText]:
    """Return the printed lines of one robot without those that ``say`` added."""
    spoken_counts = Counter((line.t, line.text) for line in recording.spoken)
    printed_only = []
    for line in recording.printed:
        if spoken_counts[line.t, line.text]:
            spoken_counts[line.t, line.text] -= 1
        else:
            printed_only.append(line)
    return printed_only


def has_no_responder(recording: Recording) -> bool:
    """Return whether the simulator answered instead of a responder: every answer repeats the text after one word."""
    messages = recording.messages
    answers = [each for each in messages if each.sender == "responder"]
    return bool(answers) and all(
        each.reply_to is not None and each.text == STAND_IN_PREFIX + messages[each.reply_to].received
        for each in answers
    )


def collect_faults(recording: Recording) -> tuple[Fault, ...]:
    """Return the faults of all robots, earliest first. At equal times, the first robot's faults come first."""
    partners = recording.partner.faults if recording.partner is not None else ()
    return tuple(sorted((*recording.faults, *partners), key=lambda fault: fault.t))


def decide_verdict(recording: Recording) -> Verdict:
    """Return the verdict of the trial, decided by the earliest fault of any robot."""
    if recording.partner is None:
        return recording.verdict
    return next((fault.verdict for fault in collect_faults(recording)), Verdict.FINISHED)


def tick_to_seconds(recording: Recording, tick: int) -> float:
    """Return the time in seconds at the end of a tick."""
    return tick * recording.ticks.length / SECOND


def count_ticks_until(recording: Recording, t: float) -> int:
    """Return the number of ticks completed at ``t`` seconds."""
    return int(t * recording.ticks.per_second + 1e-6)


def get_pose_after(recording: Recording, tick: int) -> Pose:
    """Return the pose after this number of ticks: the start pose before the first, the final pose after the last."""
    ticks = recording.ticks
    count = min(tick, len(ticks))
    if count < 1:
        return recording.start
    return Pose(float(ticks.x[count - 1]), float(ticks.y[count - 1]), float(ticks.heading[count - 1]))


def get_pose_at(recording: Recording, t: float) -> Pose:
    """Return the pose at ``t`` seconds, taken after the last completed tick."""
    return get_pose_after(recording, count_ticks_until(recording, t))
