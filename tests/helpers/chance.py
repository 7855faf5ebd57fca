"""A small assignment with every kind of chance, and programs whose marks depend on the light noise alone or on none."""

from __future__ import annotations

from dataclasses import replace

from judging import criterion
from responders.channel import Channel
from responders.source_file import SourceFile
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import read_example
from submissions.assignment.reader import find_assignment
from submissions.submission import Submission

_GUESSES = """%%sim_magic_preloaded
if colorLeft.reflected_light_intensity_pc > 99:
    say("bright")
"""
_ALWAYS = """%%sim_magic_preloaded
say("bright")
"""
_DRIVES_AND_SENDS = """for number in range(8):
    print("PY::1")
tank_drive.on_for_seconds(SpeedPercent(30), SpeedPercent(30), 1)
"""


def chance_assignment() -> Assignment:
    """Return an assignment with one short trial."""
    (scenario, *_) = find_assignment("lossy-echo").scenarios
    scenario = replace(
        scenario,
        trials=1,
        seconds=5,
        light_noise=(8.0,),
        motor_noise=(20.0,),
        start_jitter=(5.0, 0.0, 0.0),
        channel=Channel(loss=0.5),
    )
    says = criterion("says", id="says", title="Says it", at_least=1, over="mean")
    ends = criterion("finishes", id="ends", title="Ends", over="mean")
    return replace(
        find_assignment("lossy-echo"), id="chance", version="1", scenarios=(scenario,), criteria=(says, ends)
    )


def chance_submission(student: str, guesses: bool) -> Submission:
    """Return a submission that says something in trials that the light noise decides, or always."""
    text = (_GUESSES if guesses else _ALWAYS) + _DRIVES_AND_SENDS
    reference = read_example("lossy-echo", "reference")
    return replace(reference, student=student, program=SourceFile("robot.py", text))
