"""Runs one trial whose responder is outside: only the program runs here, and an answerer answers its texts.

Its recording has the same hash as that of ``trial.py`` with a responder process that gives the same answers.
"""

from __future__ import annotations

from dataclasses import dataclass

from responders.bridge import Bridge
from responders.outside_responder import OutsideAnswerer, OutsideQuestion, OutsideResponder, Unanswered
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.trial import build_recording
from responders.trial_spec import TrialSpec
from sim.arena import Arena
from sim.camera import LightCamera
from sim.recording import Recording


@dataclass(frozen=True, slots=True)
class AnsweredRun:
    """The recording of a run, and the question at which it ended because nobody answered it, if there is one."""

    recording: Recording
    open_question: OutsideQuestion | None


def run_answered_trial(
    spec: TrialSpec, arena: Arena, camera: LightCamera, sandboxes: Sandboxes, meter: JobMeter, ask: OutsideAnswerer
) -> AnsweredRun:
    """Run a program once in a fresh child. ``ask`` answers its texts, and may end the run with ``Unanswered``.

    Raises:
        HostError: If the machine fails, not the student's code.
        RobomarkError: Whatever else ``ask`` raises.
    """
    responder = OutsideResponder(ask, spec.program.output_bytes, meter)
    program = sandboxes.spawn(spec.program.role, spec.program.limits, meter=meter)
    fault = open_question = None
    try:
        bridge = Bridge(spec, arena, camera, program, responder, meter)
        try:
            fault = bridge.run()
        except Unanswered as end:
            open_question = end.question
    finally:
        program.close()
    bridge.conversation.finish()
    faults = sorted((*bridge.conversation.faults, *([fault] if fault else [])), key=lambda each: each.t)
    return AnsweredRun(build_recording(spec, bridge, tuple(faults), program.sandbox), open_question)
