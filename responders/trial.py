"""Runs one trial: fresh children and a private folder are set up, the bridge serves them, and a recording remains.

Nothing outlives a trial but its recording; what the program and the responder do meanwhile is ``bridge.py``'s.
"""

from __future__ import annotations

from dataclasses import replace

from responders import message_format
from responders.agents import Position, agents_beside
from responders.bridge import Bridge
from responders.logger_file import read_log
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.trial_spec import TrialSpec
from sim.arena import Arena
from sim.camera import LightCamera
from sim.recording import SECOND, Fault, Recording, Verdict

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
    with sandboxes.private_folder() as folder, agents_beside(spec.agents, spec.child_seed, sandboxes, meter) as agents:
        responder = None
        if spec.responder is not None:
            responder = ResponderProcess(spec.responder, sandboxes, folder, spec.child_seed, meter, agents)
        try:
            program = sandboxes.spawn(spec.program.role, spec.program.limits, meter=meter)
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
        if agents is not None:
            agents.seal(bridge.chain, bridge.now)
            agents.finish()
    bridge.conversation.finish()
    of_agents = agents.faults if agents is not None else ()
    faults = [each for each in (*of_agents, unloadable, *bridge.conversation.faults, fault, unread) if each is not None]
    faults.sort(key=lambda each: each.t)
    recording = recording_of(spec, bridge, tuple(faults), program.sandbox)
    if responder is None:
        return recording
    recording = replace(
        recording,
        calls=tuple(responder.calls),
        responder_output="\n".join(responder.output),
        responder_log=log,
        notes=(*recording.notes, *responder.notes, *(agents.notes if agents is not None else ()))[:MOST_NOTES],
    )
    return recording if agents is None else agents.add_outputs(agents.add_talk(recording, Position()))


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
