"""Runs one trial: fresh children and a private folder are set up, the bridge serves them, and a recording remains.

Nothing outlives a trial but its recording; what the program and the responder do meanwhile is ``bridge.py``'s.
"""

from __future__ import annotations

import os
import stat
from dataclasses import replace
from pathlib import Path

from responders import message_format
from responders.bridge import Bridge
from responders.faults import stopped
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped, JobMeter
from responders.trial_spec import TrialSpec
from sim.arena import Arena
from sim.camera import LightCamera
from sim.recording import SECOND, Fault, Recording, Verdict

_LOG_FILE = "logger.txt"
_LOG_BYTES = 1 << 20
MOST_NOTES = 40


def run_trial(
    spec: TrialSpec,
    arena: Arena,
    camera: LightCamera,
    sandboxes: Sandboxes,
    meter: JobMeter,
) -> Recording:
    """One run of a program from start to end, in fresh children; ``meter`` counts what their job costs.

    Raises HostError when the machine, not the student, fails.
    """
    with sandboxes.private_folder() as folder:
        responder = None
        if spec.responder is not None:
            responder = ResponderProcess(spec.responder, sandboxes, folder, spec.child_seed, meter)
        try:
            program = sandboxes.spawn("robot", spec.program.limits, meter=meter)
            try:
                unloadable = responder.load() if responder is not None else None
                bridge = Bridge(spec, arena, camera, program, responder, meter)
                fault = bridge.run()
            finally:
                program.close()
        finally:
            if responder is not None:
                responder.close()
        log, unread = read_log(folder, meter) if responder is not None else ("", None)
    bridge.conversation.finish()
    faults = [each for each in (unloadable, *bridge.conversation.faults, fault, unread) if each is not None]
    faults.sort(key=lambda each: each.t)
    recording = recording_of(spec, bridge, tuple(faults), program.sandbox)
    if responder is None:
        return recording
    return replace(
        recording,
        calls=tuple(responder.calls),
        responder_output="\n".join(responder.output),
        responder_log=log,
        notes=(*recording.notes, *responder.notes)[:MOST_NOTES],
    )


def recording_of(spec: TrialSpec, bridge: Bridge, faults: tuple[Fault, ...], sandbox: str) -> Recording:
    """What a bridge that has served its program has seen, but for what the responder's process told of itself."""
    world = bridge.world
    data = (message_format.datum(line.text, line.t) for line in bridge.printed)
    return Recording(
        background=spec.floor.name,
        start=spec.pose,
        end=world.pose,
        end_t=bridge.now / SECOND,
        ticks=world.ticks(),
        verdict=faults[0].verdict if faults else Verdict.FINISHED,
        sha256=bridge.chain.hexdigest(),
        printed=tuple(bridge.printed),
        spoken=tuple(bridge.spoken),
        messages=tuple(bridge.conversation.messages),
        images=tuple(bridge.images),
        datalog=tuple(datum for datum in data if datum is not None),
        image_log=tuple(bridge.image_log),
        touches=tuple(world.touches),
        faults=faults,
        obstacles=world.obstacles,
        beacon=spec.channel.beacon,
        label_patches=spec.floor.label_patches,
        sheet=spec.floor.sheet,
        robot=spec.robot.name,
        pen=((0, True),) if spec.pen_down else (),
        sandbox=sandbox,
        notes=tuple(bridge.notes)[:MOST_NOTES],
    )


def read_log(folder: Path, meter: JobMeter) -> tuple[str, Fault | None]:
    """The responder's logger.txt, read after its process is gone: a regular file only, no link, capped and paid for."""
    directory = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fd = os.open(_LOG_FILE, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=directory)
    except OSError:
        return "", None
    finally:
        os.close(directory)
    with os.fdopen(fd, "rb") as file:
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            return "", None
        data = file.read(_LOG_BYTES)
    try:
        meter.keep(len(data))
    except ChildStopped as stop:
        return "", stopped(stop, "responder", 0)
    return data.decode("utf-8", "replace"), None
