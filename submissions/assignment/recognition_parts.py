"""What a recognition criterion and a training table need from the rest of an assignment: labels, places, sweeps.

What such a table may hold by itself is in ``criteria/classification.py`` and ``schema.py``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sim.backgrounds import Floor, label_names
from sim.errors import UsageError
from submissions.assignment.definition import Scenario, Training
from submissions.assignment.problems import Problems
from submissions.assignment.schema import TrainingTable, did_you_mean
from submissions.assignment.toml_lines import Path as Place
from submissions.assignment.truth_file import read_places
from submissions.criteria.classification import Recognition, Robustness
from submissions.criteria.reporting import Reports

_NOISES = ("light_noise", "motor_noise")


def completed(
    criterion: Recognition,
    aliases: Mapping[str, tuple[str, ...]],
    files: Mapping[str, bytes],
    place: Place,
    problems: Problems,
) -> Recognition:
    """The criterion with the assignment's aliases, and with the rows of its file of places in place of the name."""
    update: dict[str, object] = {"aliases": {**aliases, **criterion.aliases}}
    if isinstance(criterion.places, str):
        try:
            update["places"] = read_places(criterion.places, files)
        except UsageError as error:
            problems.add((*place, "places"), str(error))
    return criterion.model_copy(update=update)


def check_recognition(
    criterion: Recognition,
    scenarios: Sequence[Scenario | None],
    ground: Floor | None,
    place: Place,
    problems: Problems,
) -> None:
    """Labels on the floor, label patches to decode, a truth for every pose, a sweep to judge along must be there."""
    own = [
        scenario
        for scenario in scenarios
        if scenario is not None and (not criterion.scenarios or scenario.id in criterion.scenarios)
    ]
    if isinstance(criterion.truth, tuple):
        for scenario in own:
            if len(criterion.truth) != len(scenario.poses):
                problems.add(
                    (*place, "truth"),
                    f"truth has {len(criterion.truth)} labels for the {len(scenario.poses)} poses of scenario "
                    f'"{scenario.id}", expected one label for each pose',
                )
    elif criterion.truth != "places" and ground is not None and not ground.labels:
        problems.add(
            (*place, "truth"),
            f'truth is "{criterion.truth}", but {ground.name} has no labels, '
            "expected a list with one label for each pose, or places",
        )
    elif criterion.truth == "grey" and ground is not None and not ground.label_patches:
        problems.add(
            (*place, "truth"),
            'truth is "grey", but the world has labels = false, expected truth = "label" or label patches',
        )
    if isinstance(criterion, Robustness) and not any(_varies(scenario, criterion.along) for scenario in own):
        problems.add(
            (*place, "along"),
            f'along is "{criterion.along}", but no scenario of the criterion is swept over it, '
            f"expected [scenario.sweep] with {criterion.along} = [...]",
        )


def check_reports(criterion: Reports, scenarios: Sequence[Scenario | None], place: Place, problems: Problems) -> None:
    """What is to be reported: one list for all poses, or one for each pose of every scenario that is looked at."""
    if criterion.expected == "label" or len(criterion.expected) == 1:
        return
    for scenario in scenarios:
        looked_at = scenario is not None and (not criterion.scenarios or scenario.id in criterion.scenarios)
        if scenario is not None and looked_at and len(criterion.expected) != len(scenario.poses):
            problems.add(
                (*place, "expected"),
                f"expected has {len(criterion.expected)} lists for the {len(scenario.poses)} poses of scenario "
                f'"{scenario.id}", expected one list for each pose, or one for all',
            )


def checked_training(
    table: TrainingTable, scenarios: Sequence[Scenario | None], ground: Floor | None, problems: Problems
) -> Training:
    """The training table, if there are scenarios to train on and others to be tested on, over a floor with labels."""
    ids = [scenario.id for scenario in scenarios if scenario is not None]
    hidden = [scenario.id for scenario in scenarios if scenario is not None and scenario.visibility != "visible"]
    for number, name in enumerate(table.scenarios):
        if name in hidden:
            sentence = f'scenarios names "{name[:60]}", which is not visible, expected one whose images may be told'
            problems.add(("training", "scenarios", number), sentence)
        if name not in ids:
            problems.add(
                ("training", "scenarios", number),
                f'scenarios names "{name[:60]}", expected the id of a scenario{did_you_mean(name, ids)}',
            )
    if ids and not set(ids) - set(table.scenarios):
        problems.add(
            ("training", "scenarios"), "scenarios names every scenario, expected one whose images are not trained on"
        )
    if ground is not None and not label_names(ground.name):
        problems.add(
            ("training",), f"the images of {ground.name} have no labels to train with, expected a floor that has"
        )
    return Training(table.scenarios, table.function, table.image)


def _varies(scenario: Scenario, condition: str) -> bool:
    levels = getattr(scenario.sweep, condition) or (getattr(scenario, condition) if condition in _NOISES else ())
    return len(levels) > 1
