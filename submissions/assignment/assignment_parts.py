"""Construction of an ``Assignment`` from the tables of its file and the files beside it.

This module checks relations between tables. ``schema.py`` validates single tables, and ``reader.py`` reads the folder.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from types import MappingProxyType

from responders import library
from responders.channel import Channel
from sim.errors import UsageError
from sim.floors import (
    HEIGHT,
    WIDTH,
    Floor,
    build_floor,
    build_floor_from_image,
    list_floor_names,
    list_label_names,
    list_seeded_floor_names,
)
from sim.motion import measure_gap
from sim.recording import Pose
from sim.robot import get_default_robot_name
from submissions.assignment.criterion_parts import check_given_files, read_check_sources, read_criteria
from submissions.assignment.definition import Assignment, Parts, Reruns, Scenario, Training, WorldSpec
from submissions.assignment.limits import Limits
from submissions.assignment.other_parts import SAME, build_second_poses, check_reruns, check_robots, read_agents
from submissions.assignment.pools import read_draw
from submissions.assignment.problems import Path as Place
from submissions.assignment.problems import Problems, check_table, check_unique_id, filter_texts, read_tables
from submissions.assignment.scenario import Sweep
from submissions.assignment.schema import (
    HeadTable,
    LimitsTable,
    PartsTable,
    RerunsTable,
    ScenarioTable,
    TrainingTable,
    WorldTable,
)
from submissions.criteria.common import AssignmentContext
from submissions.source_text import decode_source
from submissions.suggestions import join_with_or, suggest_name

_HEAD = tuple(HeadTable.model_fields)
_TABLES = ("world", "parts", "agents", "limits", "training", "reruns", "scenario", "criterion")
_IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
_MAX_TRIALS = 5000
#: Maximum entries of a list or table in the file. A list of poses is the longest, with at least one trial per pose.
_MAX_ENTRIES = 5000
_MAX_TABLES = 500

Files = Mapping[str, bytes]


def build_assignment(document: Mapping[str, object], files: Files, problems: Problems) -> Assignment | None:
    """Build the assignment. Add mistakes to ``problems``, and return None if they prevent it."""
    _check_lengths(document, (), problems)
    if problems.found:
        return None
    for key in document:
        if key not in _HEAD and key not in _TABLES:
            known_keys = (*_HEAD, *_TABLES)
            problems.add(
                (key,),
                f'"{key[:60]}" is not a key here, expected {join_with_or(known_keys)}{suggest_name(key, known_keys)}',
            )
    head = check_table(HeadTable, {k: v for k, v in document.items() if k in _HEAD}, (), problems)
    world_table = check_table(WorldTable, document.get("world", {}), ("world",), problems)
    parts = check_table(PartsTable, document.get("parts", {}), ("parts",), problems)
    limits = check_table(LimitsTable, document.get("limits", {}), ("limits",), problems)
    reruns = check_table(RerunsTable, document.get("reruns", {}), ("reruns",), problems)
    ground = _load_floor(world_table or _read_background_only(document), files, problems)
    world = _build_world(world_table, ground, files, problems) if world_table and ground else None
    is_robotless = _runs_no_robot(document)
    scenarios = [] if is_robotless else _build_scenarios(document, ground, problems)
    if world_table and parts:
        check_robots(document, world_table, parts, problems)
    agents, agents_sources = read_agents(document, parts, files, problems)
    _check_beacons(scenarios, world, problems)
    context = AssignmentContext(
        scenarios=[scenario for scenario in scenarios if scenario],
        ground=ground,
        without=_find_absent_parts(parts),
        agents=frozenset(agents),
        robots=world_table.robots if world_table else 1,
        files=files,
        aliases=head.aliases if head else {},
    )
    criteria = read_criteria(document, context, is_robotless, problems)
    training = None
    if "training" in document:
        training_table = check_table(TrainingTable, document["training"], ("training",), problems)
        training = _build_training(training_table, scenarios, ground, problems) if training_table else None
    check_given_files(document, problems)
    if reruns and parts:
        check_reruns(reruns, parts, context.robots, agents, scenarios, problems)
    given_parts = read_check_sources(criteria, files, problems)
    given_parts |= _read_given_parts(parts, is_robotless, files, problems) if parts else {}
    given_parts |= agents_sources
    given_files = _collect_given_files(document, files, problems)
    if problems.found or not (head and world and parts and limits and reruns):
        return None
    assignment = Assignment(
        id=head.id,
        title=head.title,
        world=world,
        parts=Parts(
            parts.program,
            parts.responder,
            str(parts.cell),
            parts.second_program if world.robots == 2 else "none",
            MappingProxyType(dict(agents)),
        ),
        scenarios=tuple(scenario for scenario in scenarios if scenario),
        criteria=criteria,
        limits=Limits(**limits.model_dump()),
        section=head.section,
        description=head.description,
        given=MappingProxyType(given_files),
        given_parts=MappingProxyType(given_parts),
        version=_compute_version(
            files, given_files, {name: text for name, text in given_parts.items() if name not in files}
        ),
        training=training,
        secret=head.secret,
        reruns=Reruns(**reruns.model_dump()),
    )
    if assignment.trial_count > _MAX_TRIALS:
        problems.add(("scenario",), f"the scenarios ask for too many trials, expected at most {_MAX_TRIALS} in all")
        return None
    return assignment


def _check_lengths(value: object, table_path: Place, problems: Problems) -> None:
    """Report lists and tables that are too long; comparing their entries would take minutes."""
    if not isinstance(value, list | dict):
        return
    maximum = (
        _MAX_TABLES if isinstance(value, list) and any(isinstance(entry, dict) for entry in value) else _MAX_ENTRIES
    )
    if len(value) > maximum:
        name = ".".join(str(part) for part in table_path)[:60] or "the file"
        problems.add(table_path, f"{name} has {len(value)} entries, expected at most {maximum}")
        return
    for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
        _check_lengths(entry, (*table_path, key), problems)


def _compute_version(files: Files, given_files: Files, packaged: Mapping[str, str]) -> str:
    """Return the SHA-256 over names and bytes, sorted by name. Packaged networks and responders count as files."""
    digest = hashlib.sha256()
    responders = {name: text.encode() for name, text in packaged.items()}
    for kind, group in (("file", files), ("given", given_files), ("responder", responders)):
        for name in sorted(group):
            digest.update(f"{kind}:{len(name.encode())}:{name}:{len(group[name])}:".encode() + group[name])
    return digest.hexdigest()


def _read_background_only(document: Mapping[str, object]) -> WorldTable:
    """Return a world with only the background, so that other mistakes in the table don't prevent its check."""
    world = document.get("world")
    name = world.get("background") if isinstance(world, dict) else None
    return WorldTable(background=name) if isinstance(name, str) else WorldTable()


def _load_floor(table: WorldTable, files: Files, problems: Problems) -> Floor | None:
    name = table.background
    key_path = ("world", "background")
    try:
        if name in list_floor_names():
            return build_floor(name, labels=table.labels)
        if name.lower().endswith(_IMAGE_SUFFIXES) and name in files:
            return build_floor_from_image(name, files[name])
    except UsageError as error:
        problems.add(key_path, f"{str(error).rstrip('.')}, expected an image that can be used")
        return None
    if name.lower().endswith(_IMAGE_SUFFIXES):
        problems.add(key_path, f'background is "{name[:60]}", expected an image beside this file')
        return None
    hint = suggest_name(name, list_floor_names()) or f"; there are {', '.join(list_floor_names())}"
    problems.add(
        key_path, f'background is "{name[:60]}", expected a background or an image (.png, .jpg) beside this file{hint}'
    )
    return None


def _build_world(table: WorldTable, ground: Floor, files: Files, problems: Problems) -> WorldSpec:
    name = table.background
    if "sheet" in table.model_fields_set and name not in list_seeded_floor_names():
        seeded_floors = join_with_or(list_seeded_floor_names())
        problems.add(("world", "sheet"), f"{name} is not drawn from a seed, expected sheet only with {seeded_floors}")
    obstacles = table.obstacles if "obstacles" in table.model_fields_set else ground.obstacles
    for number, (x, y, width, height) in enumerate(obstacles):
        if width <= 0 or height <= 0 or not (0 <= x <= WIDTH and 0 <= y <= HEIGHT):
            problems.add(
                ("world", "obstacles", number),
                f"obstacles[{number}] is not on the floor, expected [x, y, width, height] within {WIDTH} x {HEIGHT} mm",
            )
    robot = table.robot if "robot" in table.model_fields_set else get_default_robot_name(name)
    return WorldSpec(
        name,
        files.get(name) if name not in list_floor_names() else None,
        labels=table.labels,
        obstacles=obstacles,
        robot=robot,
        robots=table.robots,
        solid=table.solid,
        drive=table.drive,
        noise=table.noise,
        tick=table.tick,
        sheet=_choose_sheet_seed(table),
    )


def _choose_sheet_seed(table: WorldTable) -> int | None:
    """Return the seed of the digit sheet; None if each trial has its own."""
    if table.sheet == "per-seed":
        return None
    return table.sheet if isinstance(table.sheet, int) else 0


def _build_scenarios(
    document: Mapping[str, object], ground: Floor | None, problems: Problems
) -> Sequence[Scenario | None]:
    tables = read_tables(document, "scenario", problems)
    id_counts: dict[str, int] = {}
    scenarios = []
    for number, raw in enumerate(tables):
        table_path = ("scenario", number)
        table = check_table(ScenarioTable, raw, table_path, problems)
        check_unique_id(raw, id_counts, table_path, "scenario", problems)
        scenarios.append(_build_scenario(table, ground, table_path, problems) if table else None)
    return scenarios


def _build_scenario(
    table: ScenarioTable, ground: Floor | None, table_path: Place, problems: Problems
) -> Scenario | None:
    for key in ("poses", "second_poses"):
        for number, (x, y, _) in enumerate(getattr(table, key)):
            if not (0 <= x <= WIDTH and 0 <= y <= HEIGHT):
                problems.add(
                    (*table_path, key, number),
                    f"{key}[{number}] is off the floor, expected x from 0 to {WIDTH} and y from 0 to {HEIGHT}",
                )
    poses = tuple(Pose(*pose) for pose in table.poses)
    if not poses:
        poses = (ground.default_pose if ground else Pose(100, 800, 0),)
    second_poses = build_second_poses(table, len(poses), table_path, problems)
    draw = read_draw(table, len(poses), table_path, problems)
    return Scenario(
        id=table.id,
        poses=poses,
        title=table.title,
        choose=table.choose,
        trials=table.pool or (table.trials if isinstance(table.trials, int) else 1),
        seconds=table.seconds,
        light_noise=table.light_noise,
        motor_noise=table.motor_noise,
        channel=Channel(**table.channel.model_dump()),
        visibility=table.visibility,
        start_jitter=table.start_jitter,
        sweep=Sweep(**table.sweep.model_dump()),
        second_poses=second_poses,
        draw=draw,
    )


def _check_beacons(scenarios: Sequence[Scenario | None], world: WorldSpec | None, problems: Problems) -> None:
    """Report beacons inside an obstacle, which would block every path to them."""
    for number, scenario in enumerate(scenarios):
        beacon = scenario.channel.beacon if scenario and scenario.channel.blocked_by == "obstacles" else None
        if world and beacon and any(measure_gap(box, *beacon) == 0 for box in world.obstacles):
            sentence = "beacon is in an obstacle, which blocks every way to it, expected a place beside them"
            problems.add(("scenario", number, "channel", "beacon"), sentence)


def _find_absent_parts(parts: PartsTable | None) -> frozenset[str]:
    return frozenset(part for part in ("program", "responder") if parts and getattr(parts, part) == "none")


def _read_given_parts(parts: PartsTable, is_robotless: bool, files: Files, problems: Problems) -> dict[str, str]:
    sources = {}
    for part in ("program", "responder", "second_program"):
        name = getattr(parts, part)
        if name == "student" or name == (SAME if part == "second_program" else "none"):
            continue
        if part == "responder" and name not in files and name in library.names():
            sources[name] = library.source(name)
            continue
        if name not in files or not name.endswith(".py"):
            alternatives = {"program": "", "second_program": f', "{SAME}"'}.get(
                part, f', "none", {", ".join(library.names())}'
            )
            problems.add(
                ("parts", part),
                f'{part} is "{name[:60]}", expected "student"{alternatives} or a .py file beside this file',
            )
            continue
        try:
            sources[name] = decode_source(files[name], name).text
        except UsageError as error:
            problems.add(("parts", part), str(error).rstrip("."))
    if parts.program == "none" and not is_robotless:
        problems.add(
            ("parts", "program"), 'program is "none", expected "student" or a .py file: a trial runs a program'
        )
    return sources


def _collect_given_files(document: Mapping[str, object], files: Files, problems: Problems) -> dict[str, bytes]:
    given_files = {}
    for number, name in enumerate(filter_texts(document.get("given"))):
        if name in files and "/" not in name:
            given_files[name] = files[name]
        else:
            problems.add(("given", number), f'given names "{name[:60]}", expected a file beside this file')
    models = document.get("given_models")
    for name, model in models.items() if isinstance(models, dict) else ():
        if not isinstance(model, str):
            continue
        key_path = ("given_models", name)
        data = load_packaged_model(model)
        if not re.fullmatch(r"[\w][\w.-]*", name):
            problems.add(
                key_path, f'given_models has the file name "{name[:60]}", expected letters, digits, ., - and _'
            )
        elif name in given_files:
            problems.add(key_path, f'"{name}" is given twice, expected it in given or in given_models')
        elif data is None:
            packaged_names = list_packaged_models()
            problems.add(
                key_path,
                f'"{model[:60]}" is not a packaged model, expected '
                f"{join_with_or(packaged_names) if packaged_names else 'one (there are none)'}"
                f"{suggest_name(model, packaged_names)}",
            )
        else:
            given_files[name] = data
    return given_files


def list_packaged_models() -> tuple[str, ...]:
    """Return the names of the packaged networks, as on their cards."""
    folder = _locate_weights_folder()
    return tuple(sorted(card.stem for card in folder.glob("*.json"))) if folder.is_dir() else ()


def load_packaged_model(name: str) -> bytes | None:
    """Return the bytes of a packaged network, for use by student code inside the sandbox; None if it does not exist."""
    if name not in list_packaged_models():
        return None
    card = json.loads((_locate_weights_folder() / f"{name}.json").read_text("utf-8"))
    return (_locate_weights_folder() / str(card["file"])).read_bytes()


def _locate_weights_folder() -> Path:
    return Path(str(resources.files("models"))) / "weights"


def _build_training(
    table: TrainingTable, scenarios: Sequence[Scenario | None], ground: Floor | None, problems: Problems
) -> Training:
    """Return the training table. Report missing scenarios for training or for tests, and a floor without labels."""
    ids = [scenario.id for scenario in scenarios if scenario is not None]
    hidden_ids = [scenario.id for scenario in scenarios if scenario is not None and scenario.visibility != "visible"]
    for number, name in enumerate(table.scenarios):
        if name in hidden_ids:
            sentence = f'scenarios names "{name[:60]}", which is not visible, expected a visible scenario'
            problems.add(("training", "scenarios", number), sentence)
        if name not in ids:
            problems.add(
                ("training", "scenarios", number),
                f'scenarios names "{name[:60]}", expected the id of a scenario{suggest_name(name, ids)}',
            )
    if ids and not set(ids) - set(table.scenarios):
        problems.add(
            ("training", "scenarios"),
            "scenarios names every scenario, expected at least one scenario without training images",
        )
    if ground is not None and not list_label_names(ground.name):
        problems.add(
            ("training",), f"the images of {ground.name} have no labels for training, expected a floor with labels"
        )
    return Training(table.scenarios, table.function, table.image)


def _runs_no_robot(document: Mapping[str, object]) -> bool:
    """Return whether the assignment runs no robot: it has no scenarios and no program, only functions and texts."""
    parts = document.get("parts")
    return isinstance(parts, dict) and parts.get("program") == "none" and "scenario" not in document
