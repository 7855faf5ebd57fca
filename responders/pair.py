"""Runs one trial of two robots with fresh children for both programs and the responder. Each robot has a recording.

``lockstep.py`` shares the time between the two. ``trial.py`` runs trials of one robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace

from responders.lockstep import PairedBridge, serve_both
from responders.logger_file import read_log
from responders.responder_process import ResponderProcess
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.trial import MAX_NOTES, build_recording
from responders.trial_spec import PartnerSpec, TrialSpec
from sim.camera import LightCamera
from sim.recording import Fault, Recording, Verdict
from sim.shared_arena import SharedArena


def run_pair(
    spec: TrialSpec,
    partner: PartnerSpec,
    arenas: tuple[SharedArena, SharedArena],
    camera: LightCamera,
    sandboxes: Sandboxes,
    meter: JobMeter,
) -> Recording:
    """Run both programs and return the first robot's recording, which contains its partner's.

    ``meter`` counts the costs of the job.

    Raises:
        HostError: If the machine fails, not the student's code.
    """
    specs = spec, spec.build_partner_spec(partner)
    for arena, other_spec in zip(arenas, reversed(specs), strict=True):
        arena.place_partner(other_spec.pose.x, other_spec.pose.y, math.radians(other_spec.pose.heading))
    with sandboxes.open_private_folder() as folder:
        with ExitStack() as children:
            responder = None
            if spec.responder is not None:
                responder = ResponderProcess(spec.responder, sandboxes, folder, spec.child_seed, meter)
                children.callback(responder.close)
            bridges, layers = [], []
            for robot_spec, arena in zip(specs, arenas, strict=True):
                program = sandboxes.spawn(robot_spec.program.role, robot_spec.program.limits, meter=meter)
                children.callback(program.close)
                bridges.append(PairedBridge(robot_spec, arena, camera, program, meter))
                layers.append(program.sandbox)
            loading_fault = responder.load() if responder is not None else None
            first, second = bridges
            first_fault, second_fault = serve_both(first, second, responder)
        log, log_fault = read_log(folder, meter) if responder is not None else ("", None)
    for bridge in bridges:
        bridge.conversation.finish()
    for bridge in bridges:
        bridge.set_delivery_times()
    first_faults = _sort_faults((loading_fault, *first.conversation.faults, first_fault, log_fault))
    second_faults = (
        _attribute_to_second(fault, partner) for fault in _sort_faults((*second.conversation.faults, second_fault))
    )
    partner_recording = build_recording(
        specs[1], second, tuple(fault for fault in second_faults if fault is not None), layers[1]
    )
    first.chain.add("partner", second.now, partner_recording.sha256.encode())
    recording = replace(
        build_recording(spec, first, first_faults, layers[0]),
        calls=tuple(first.calls),
        partner=replace(partner_recording, calls=tuple(second.calls)),
    )
    if responder is None:
        return recording
    return replace(
        recording,
        responder_output="\n".join(responder.output),
        responder_log=log,
        notes=(*recording.notes, *responder.notes)[:MAX_NOTES],
    )


def _sort_faults(faults: Iterable[Fault | None]) -> tuple[Fault, ...]:
    return tuple(sorted((fault for fault in faults if fault is not None), key=lambda fault: fault.t))


def _attribute_to_second(fault: Fault, partner: PartnerSpec) -> Fault | None:
    """Return the fault as one of the second program. None for a time limit of a given program, which is not a fault."""
    if fault.who != "program":
        return fault
    if partner.given and fault.verdict is Verdict.TIME_LIMIT:
        return None
    return replace(fault, who="second program")
