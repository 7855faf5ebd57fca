"""The specification of a trial, from the trial of an assignment and the plan of a submission."""

from __future__ import annotations

import functools

from responders.trial_spec import PartnerSpec, TrialSpec
from service.grading.run_plan import RunPlan
from sim.errors import AssignmentError
from sim.floors import Floor, build_floor, build_floor_from_image
from sim.motion import Physics
from sim.recording import BROWSER_TICK, TICK
from sim.robot import get_robot
from sim.world import Noise
from submissions.assignment.definition import Trial, WorldSpec
from submissions.seeds import compute_child_seed


def build_trial_spec(trial: Trial, plan: RunPlan) -> TrialSpec:
    """Return the inputs of this trial. Statements and lines are recorded in visible trials only.

    Raises:
        AssignmentError: The assignment has scenarios, but no program to run in them.
    """
    world = plan.assignment.world
    if trial.scenario.visibility != "visible":
        plan = plan.to_hidden_plan()
    if plan.program is None:
        raise AssignmentError(f"Assignment {plan.assignment.id} has scenarios and no robot program to run in them.")
    return TrialSpec(
        program=plan.program,
        responder=plan.responder,
        agents=plan.agents,
        collaborative=plan.collaborative,
        floor=_build_floor(world, trial.seed),
        robot=get_robot(world.robot),
        pose=trial.pose,
        noise=Noise(trial.light_noise, trial.motor_noise, world.noise == "both directions"),
        channel=trial.channel,
        seconds=trial.scenario.seconds,
        seed=trial.seed,
        child_seed=compute_child_seed(trial.seed, plan.submission),
        pen_down="p" in plan.flags.switches,
        physics=Physics(world.solid, world.drive),
        tick=BROWSER_TICK if world.tick == "browser" else TICK,
        partner=_build_partner_spec(trial, plan),
        records_lines=trial.scenario.visibility == "visible",
    )


def _build_partner_spec(trial: Trial, plan: RunPlan) -> PartnerSpec | None:
    """Return the second robot, if there is one. A program from the assignment may run until the time limit."""
    if plan.second_program is None or trial.second_pose is None:
        return None
    is_given = plan.assignment.parts.second_program in plan.assignment.given_parts
    return PartnerSpec(plan.second_program, trial.second_pose, "p" in plan.second_flags.switches, is_given)


def _build_floor(world: WorldSpec, seed: int) -> Floor:
    if world.image is not None:
        return _load_floor_image(world.background, world.image)
    return build_floor(world.background, labels=world.labels, seed=seed if world.sheet is None else world.sheet)


@functools.lru_cache(maxsize=2)
def _load_floor_image(name: str, image: bytes) -> Floor:
    """Load the floor image once for all trials. Cameras cache images by identity."""
    return build_floor_from_image(name, image)
