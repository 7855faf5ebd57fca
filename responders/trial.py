"""Runs one trial: sets up fresh children and a private folder, serves them with the bridge, returns a recording.

Only the recording remains after a trial. ``bridge.py`` serves the program and the responder.
"""

from __future__ import annotations

from dataclasses import replace

from responders import message_format
from responders.agents import AgentCounts, running_agents
from responders.bridge import Bridge
from responders.logger_file import read_log
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.trial_spec import TrialSpec
from sim.arena import Arena
from sim.camera import LightCamera
from sim.recording import SECOND, Fault, Recording, Verdict

MAX_NOTES = 40


def run_trial(
    spec: TrialSpec,
    arena: Arena,
    camera: LightCamera,
    sandboxes: Sandboxes,
    meter: JobMeter,
) -> Recording:
    """Run a program once in fresh children. ``meter`` counts the costs of the job.

    Raises:
        HostError: If the machine fails, not the student's code.
    """
    with (
        sandboxes.open_private_folder() as folder,
        running_agents(spec.agents, spec.child_seed, sandboxes, meter) as agents,
    ):
        responder = None
        if spec.responder is not None:
            responder = ResponderProcess(spec.responder, sandboxes, folder, spec.child_seed, meter, agents)
        try:
            program = sandboxes.spawn(spec.program.role, spec.program.limits, meter=meter)
            try:
                loading_fault = responder.load() if responder is not None else None
                bridge = Bridge(spec, arena, camera, program, responder, meter)
                fault = bridge.run()
            finally:
                program.close()
        finally:
            if responder is not None:
                responder.close()
        log, log_fault = read_log(folder, meter) if responder is not None else ("", None)
        if agents is not None:
            agents.seal(bridge.chain, bridge.now)
            agents.finish()
    bridge.conversation.finish()
    agent_faults = agents.faults if agents is not None else ()
    faults = [
        each
        for each in (*agent_faults, loading_fault, *bridge.conversation.faults, fault, log_fault)
        if each is not None
    ]
    faults.sort(key=lambda each: each.t)
    recording = build_recording(spec, bridge, tuple(faults), program.sandbox)
    if responder is None:
        return recording
    recording = replace(
        recording,
        calls=tuple(responder.calls),
        responder_output="\n".join(responder.output),
        responder_log=log,
        notes=(*recording.notes, *responder.notes, *(agents.notes if agents is not None else ()))[:MAX_NOTES],
    )
    return recording if agents is None else agents.add_outputs(agents.add_messages_and_calls(recording, AgentCounts()))


def build_recording(spec: TrialSpec, bridge: Bridge, faults: tuple[Fault, ...], sandbox: str) -> Recording:
    """Return the recording of a bridge that has finished, without the data from the responder's process."""
    world = bridge.world
    data = (message_format.parse_datum(line.text, line.t) for line in bridge.printed)
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
        notes=tuple(bridge.notes)[:MAX_NOTES],
        places=bridge.places,
    )
