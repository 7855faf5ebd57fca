"""Changes by regrades: the stage that caused a difference is named right for each planted change."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn

import pytest
from _pytest.mark import ParameterSet

import acting
from builders import opened, settings_in
from pools import pool_assignment, pool_request
from responders.sandbox import roles, zygote
from service.grading.judging import judge as judging
from service.grading.judging.judge_declaration import Judge
from service.grading.trial_runner import TrialRunner
from service.queue import earlier_recordings
from service.queue.grading_job import GradingOutcome, grade_next_job
from service.settings import Settings
from service.store.batches import regrade_changes
from service.store.batches.changes import Change
from service.store.batches.intake import accept_batch
from service.store.courses.hidden_names import NO_HIDDEN_NAMES
from service.store.engine import Store
from service.store.queue import jobs
from service.store.states import ChangeStage
from sim import drive
from sim.recording import Pose
from sim.trigonometry import round_half_up
from submissions.assignment.definition import Assignment
from submissions.criteria.ending import EndPose
from submissions.seeds import Secret

ASSIGNMENT = """
id = "drive-and-tell"
title = "Drive a little with noise, then tell"
[parts]
responder = "none"
[[scenario]]
id = "calm"
poses = [[500, 500, 0]]
seconds = 5
[[scenario]]
id = "noisy"
poses = [[500, 500, 0]]
trials = 6
motor_noise = 400
seconds = 5
visibility = "hidden"
[[criterion]]
id = "lands"
title = "Ends near the goal"
marks = 4
check = "pose"
x = 590
y = 505
tolerance = 21
scenarios = ["noisy"]
[[criterion]]
id = "tells"
title = "Tells about it"
marks = 2
check = "prints"
contains = "there"
scenarios = ["calm"]
"""
PROGRAM = """
from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent
tank = MoveTank(OUTPUT_B, OUTPUT_C)
tank.on_for_seconds(SpeedPercent(50), SpeedPercent(50), 0.5)
print("I am there after a long way" + "." * 200)
"""
Patch = pytest.MonkeyPatch


@dataclass(frozen=True, slots=True)
class Plant:
    """A planted change: of the assignment, of the code, or of the secret, with the expected stages and parts."""

    stages: tuple[ChangeStage, ...]
    change: Callable[[Assignment], Assignment] | None = None
    patch: Callable[[Patch, Path], None] | None = None
    parts: tuple[str, ...] = ()
    secret: str = "the secret of the installation"


def _edit_criteria(**values: object) -> Callable[[Assignment], Assignment]:
    """Return a change of the first criterion."""

    def edit(assignment: Assignment) -> Assignment:
        first, *others = assignment.criteria
        return replace(assignment, criteria=(first.model_copy(update=values), *others))

    return edit


def _edit_scenario(**values: Any) -> Callable[[Assignment], Assignment]:
    """Return a change of the noisy scenario."""

    def edit(assignment: Assignment) -> Assignment:
        calm, noisy = assignment.scenarios
        return replace(assignment, scenarios=(calm, replace(noisy, **values)))

    return edit


def _patch_judge(patch: Patch, _: Path) -> None:
    """Make the judge of poses stricter: only 3 mm are near."""
    own = judging.JUDGES[EndPose]
    strict = Judge(EndPose, lambda criterion, case: own.judge(criterion.model_copy(update={"tolerance": 3.0}), case))
    patch.setattr(judging, "JUDGES", MappingProxyType({**judging.JUDGES, EndPose: strict}))


def _patch_simulator(patch: Patch, _: Path) -> None:
    patch.setattr(drive, "MAX_SPEED", 300.0)


def _patch_simulator_a_little(patch: Patch, _: Path) -> None:
    """Change the recordings, but no marks."""
    patch.setattr(drive, "round_half_up", lambda number: round_half_up(number) + 0.001)


def _patch_judge_and_simulator(patch: Patch, folder: Path) -> None:
    _patch_judge(patch, folder)
    _patch_simulator_a_little(patch, folder)


def _patch_kit(patch: Patch, folder: Path) -> None:
    """Let children import a copy of the kit that drives half as long."""
    kit = folder / "brick"
    shutil.copytree(roles.find_module_folder("robot"), kit)
    pairs = kit / "ev3dev2" / "motor_pairs.py"
    pairs.write_text(pairs.read_text().replace("time_sp=float(seconds)", "time_sp=float(seconds) / 2"))
    find = roles.find_module_folder
    patch.setattr(zygote, "find_module_folder", lambda role: str(kit) if role.startswith("robot") else find(role))


#: The ten changes that occur in courses, each alone.
SINGLE = {
    "boundary raised": Plant((ChangeStage.CRITERIA,), _edit_criteria(tolerance=3.0)),
    "marks changed": Plant((ChangeStage.CRITERIA,), _edit_criteria(marks=Decimal(8))),
    "judge changed": Plant((ChangeStage.JUDGING,), patch=_patch_judge),
    "simulator changed": Plant((ChangeStage.SIMULATOR,), patch=_patch_simulator),
    "kit changed": Plant((ChangeStage.SIMULATOR,), patch=_patch_kit),
    "start moved": Plant((ChangeStage.ASSIGNMENT,), _edit_scenario(poses=(Pose(560, 500, 0),)), parts=("scenarios",)),
    "noise changed": Plant((ChangeStage.ASSIGNMENT,), _edit_scenario(motor_noise=(20.0,)), parts=("scenarios",)),
    "trials changed": Plant((ChangeStage.ASSIGNMENT,), _edit_scenario(trials=13), parts=("scenarios",)),
    "limits changed": Plant(
        (ChangeStage.ASSIGNMENT,),
        lambda own: replace(own, limits=replace(own.limits, output_bytes=100)),
        parts=("limits",),
    ),
    "hidden seeds changed": Plant(
        (ChangeStage.ASSIGNMENT,), lambda own: replace(own, secret="other"), parts=("secret",)
    ),
}
#: Further changes, and several at once.
FURTHER = {
    "secret of the installation changed": Plant((ChangeStage.SECRET,), secret="another secret"),
    "judge and boundary changed": Plant((ChangeStage.CRITERIA,), _edit_criteria(tolerance=1000.0), lambda *_: None),
    "judge changed, simulator without effect": Plant(
        (ChangeStage.JUDGING,),
        patch=_patch_judge_and_simulator,
    ),
    "boundary raised, simulator without effect": Plant(
        (ChangeStage.CRITERIA,), _edit_criteria(tolerance=3.0), _patch_simulator_a_little
    ),
    "other title, simulator changed": Plant((ChangeStage.SIMULATOR,), _edit_criteria(title="Other"), _patch_simulator),
    "noise and simulator changed": Plant(
        (ChangeStage.SIMULATOR, ChangeStage.ASSIGNMENT),
        _edit_scenario(motor_noise=(20.0,)),
        _patch_simulator,
        ("scenarios",),
    ),
    "noise and release changed": Plant(
        (ChangeStage.ASSIGNMENT,), _edit_scenario(motor_noise=(20.0,)), lambda *_: None, ("scenarios",)
    ),
}


#: Those that run with the other tests; each takes seconds.
_QUICK = {
    "boundary raised",
    "judge changed",
    "kit changed",
    "noise changed",
    "boundary raised, simulator without effect",
}


def _list_cases(plants: Mapping[str, Plant]) -> list[ParameterSet]:
    return [
        pytest.param(plant, id=name, marks=[] if name in _QUICK else [pytest.mark.long])
        for name, plant in plants.items()
    ]


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return settings_in(tmp_path / "home")


@pytest.fixture
def sqlite_store(settings: Settings) -> Iterator[Store]:
    with opened(settings) as own_store:
        yield own_store


def _grade_next(store: Store, settings: Settings, runner: TrialRunner) -> None:
    assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.GRADED


def _regrade(
    store: Store, settings: Settings, runner: TrialRunner, plant: Plant, folder: Path, patch: Patch
) -> tuple[Change, ...]:
    """Grade a submission, plant the change, grade it again, and return the changes."""
    assignment = pool_assignment(folder / "assignment", ASSIGNMENT)
    store = replace(store, secret=Secret("the secret of the installation"))
    batch = accept_batch(store, "class", [pool_request(assignment, program=PROGRAM)], [], max_attempts=3)
    _grade_next(store, settings, runner)
    changed = None if plant.change is None else replace(plant.change(assignment), version="changed")
    regrade = acting.regrade(store, batch.id, changed)
    store = replace(store, secret=Secret(plant.secret))
    if plant.patch is None:
        _grade_next(store, settings, runner)
    else:
        for module in (jobs, earlier_recordings):
            patch.setattr(module, "hash_grader", lambda: "f" * 64)
        plant.patch(patch, folder)
        with TrialRunner() as own_runner:
            _grade_next(store, settings, own_runner)
    with store.reading() as session:
        return tuple(regrade_changes.load_changes(session, regrade.batch_id, NO_HIDDEN_NAMES))


@pytest.mark.long
@pytest.mark.parametrize("plant", _list_cases(SINGLE))
def test_a_planted_change_is_named(
    sqlite_store: Store, settings: Settings, runner: TrialRunner, tmp_path: Path, monkeypatch: Patch, plant: Plant
) -> None:
    (change,) = _regrade(sqlite_store, settings, runner, plant, tmp_path, monkeypatch)
    assert change.differs, change
    assert (change.stages, change.changed_parts) == (plant.stages, plant.parts)
    assert all(criterion.stages == plant.stages for criterion in change.criteria)


def test_a_failure_to_judge_again_loses_no_grade(
    sqlite_store: Store, settings: Settings, runner: TrialRunner, tmp_path: Path, monkeypatch: Patch
) -> None:
    def fail(*_: object) -> NoReturn:
        raise RuntimeError("no judge")

    monkeypatch.setattr(earlier_recordings, "judge_within_limits", fail)
    plant = FURTHER["boundary raised, simulator without effect"]
    (change,) = _regrade(sqlite_store, settings, runner, plant, tmp_path, monkeypatch)
    assert change.differs
    assert change.stages == (ChangeStage.CRITERIA, ChangeStage.SIMULATOR)


@pytest.mark.parametrize("plant", _list_cases(FURTHER))
def test_changes_at_once_are_told_apart(
    sqlite_store: Store, settings: Settings, runner: TrialRunner, tmp_path: Path, monkeypatch: Patch, plant: Plant
) -> None:
    (change,) = _regrade(sqlite_store, settings, runner, plant, tmp_path, monkeypatch)
    assert change.differs, change
    assert (change.stages, change.changed_parts) == (plant.stages, plant.parts)
