"""From the tables of an assignment file and the files beside it to an ``Assignment``: what has to fit together.

What a single table may hold is ``schema.py``; reading the folder is ``reader.py``.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from responders import library
from responders.channel import Channel
from sim.backgrounds import HEIGHT, SEEDED, WIDTH, Floor, floor, floor_from_image, names
from sim.errors import UsageError
from sim.recording import Pose
from sim.robot import usual_robot
from submissions.assignment.code_parts import check_code, check_given, check_ranks, check_sources, runs_no_robot
from submissions.assignment.definition import Assignment, Limits, Parts, Scenario, WorldSpec
from submissions.assignment.problems import Problems
from submissions.assignment.recognition_parts import check_recognition, check_reports, checked_training, completed
from submissions.assignment.schema import (
    HeadTable,
    LimitsTable,
    PartsTable,
    ScenarioTable,
    TrainingTable,
    WorldTable,
    did_you_mean,
    listed,
    read_table,
)
from submissions.assignment.toml_lines import Path as Place
from submissions.criteria import SCHEMAS, Criterion, Messages, Recognition, Replies, Reports
from submissions.source_text import decode_source
from submissions.sweep import Sweep

T = TypeVar("T", bound=BaseModel)

_HEAD = tuple(HeadTable.model_fields)
_TABLES = ("world", "parts", "limits", "training", "scenario", "criterion")
_IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
_MAX_TRIALS = 5000
_LISTS_OF_TEXTS = {"equals", "starts_with", "contains", "in_order", "to", "to_starts_with", "scenarios", "truth"}

Files = Mapping[str, bytes]


def build_assignment(document: Mapping[str, object], files: Files, problems: Problems) -> Assignment | None:
    """The assignment, or None; whatever is wrong goes into ``problems``."""
    for key in document:
        if key not in _HEAD and key not in _TABLES:
            known = (*_HEAD, *_TABLES)
            problems.add((key,), f'"{key[:60]}" is not a key here, expected {listed(known)}{did_you_mean(key, known)}')
    head = _table(HeadTable, {k: v for k, v in document.items() if k in _HEAD}, (), problems)
    world_table = _table(WorldTable, document.get("world", {}), ("world",), problems)
    parts = _table(PartsTable, document.get("parts", {}), ("parts",), problems)
    limits = _table(LimitsTable, document.get("limits", {}), ("limits",), problems)
    ground = _ground(world_table or _background_alone(document), files, problems)
    world = _world(world_table, ground, files, problems) if world_table and ground else None
    robotless = runs_no_robot(document)
    scenarios = [] if robotless else _scenarios(document, ground, problems)
    aliases = head.aliases if head else {}
    criteria = _criteria(document, scenarios, ground, parts, aliases, files, problems)
    training = None
    if "training" in document:
        training_table = _table(TrainingTable, document["training"], ("training",), problems)
        training = checked_training(training_table, scenarios, ground, problems) if training_table else None
    check_ranks(criteria, problems)
    given_parts = check_sources(criteria, files, problems)
    check_given(document, given_parts.keys(), problems)
    given_parts |= _given_parts(parts, robotless, files, problems) if parts else {}
    given = _given(document, files, problems)
    if problems.found or not (head and world and parts and limits):
        return None
    assignment = Assignment(
        id=head.id,
        title=head.title,
        world=world,
        parts=Parts(parts.program, parts.responder, str(parts.cell)),
        scenarios=tuple(scenario for scenario in scenarios if scenario),
        criteria=criteria,
        limits=Limits(**limits.model_dump()),
        section=head.section,
        description=head.description,
        given=MappingProxyType(given),
        given_parts=MappingProxyType(given_parts),
        version=_version(files, given, {name: text for name, text in given_parts.items() if name not in files}),
        training=training,
        secret=head.secret,
    )
    if sum(1 for _ in assignment.trials()) > _MAX_TRIALS:
        problems.add(("scenario",), f"the scenarios ask for too many trials, expected at most {_MAX_TRIALS} in all")
        return None
    return assignment


def _version(files: Files, given: Files, packaged: Mapping[str, str]) -> str:
    """SHA-256 over names and bytes, in the order of the names; packaged networks and responders count like files."""
    digest = hashlib.sha256()
    responders = {name: text.encode() for name, text in packaged.items()}
    for kind, group in (("file", files), ("given", given), ("responder", responders)):
        for name in sorted(group):
            digest.update(f"{kind}:{len(name.encode())}:{name}:{len(group[name])}:".encode() + group[name])
    return digest.hexdigest()


def _table(schema: type[T], table: object, place: Place, problems: Problems) -> T | None:
    result = read_table(schema, table)
    if isinstance(result, schema):
        return result
    for problem in cast(list[Any], result):
        problems.add((*place, *problem.path), problem.sentence)
    return None


def _background_alone(document: Mapping[str, object]) -> WorldTable:
    """A world with the background of a table that has other mistakes, so that this one is looked at as well."""
    world = document.get("world")
    name = world.get("background") if isinstance(world, dict) else None
    return WorldTable(background=name) if isinstance(name, str) else WorldTable()


def _ground(table: WorldTable, files: Files, problems: Problems) -> Floor | None:
    name = table.background
    place = ("world", "background")
    try:
        if name in names():
            return floor(name, labels=table.labels)
        if name.lower().endswith(_IMAGE_SUFFIXES) and name in files:
            return floor_from_image(name, files[name])
    except UsageError as error:
        problems.add(place, f"{str(error).rstrip('.')}, expected an image that can be used")
        return None
    if name.lower().endswith(_IMAGE_SUFFIXES):
        problems.add(place, f'background is "{name[:60]}", expected an image beside this file')
        return None
    hint = did_you_mean(name, names()) or f"; there are {', '.join(names())}"
    problems.add(
        place, f'background is "{name[:60]}", expected a background or an image (.png, .jpg) beside this file{hint}'
    )
    return None


def _world(table: WorldTable, ground: Floor, files: Files, problems: Problems) -> WorldSpec:
    name = table.background
    if "sheet" in table.model_fields_set and name not in SEEDED:
        problems.add(("world", "sheet"), f"{name} is not drawn from a seed, expected sheet only with {listed(SEEDED)}")
    obstacles = table.obstacles if "obstacles" in table.model_fields_set else ground.obstacles
    for number, (x, y, width, height) in enumerate(obstacles):
        if width <= 0 or height <= 0 or not (0 <= x <= WIDTH and 0 <= y <= HEIGHT):
            problems.add(
                ("world", "obstacles", number),
                f"obstacles[{number}] is not on the floor, expected [x, y, width, height] within {WIDTH} x {HEIGHT} mm",
            )
    robot = table.robot if "robot" in table.model_fields_set else usual_robot(name)
    return WorldSpec(
        name,
        files.get(name) if name not in names() else None,
        labels=table.labels,
        obstacles=obstacles,
        robot=robot,
        solid=table.solid,
        drive=table.drive,
        noise=table.noise,
        sheet=_sheet(table),
    )


def _sheet(table: WorldTable) -> int | None:
    """The seed of the digit sheet; None when each trial has one of its own."""
    if table.sheet == "per-seed":
        return None
    return table.sheet if isinstance(table.sheet, int) else 0


def _scenarios(document: Mapping[str, object], ground: Floor | None, problems: Problems) -> Sequence[Scenario | None]:
    tables = _tables_of(document, "scenario", problems)
    seen: dict[str, int] = {}
    scenarios = []
    for number, raw in enumerate(tables):
        place = ("scenario", number)
        table = _table(ScenarioTable, raw, place, problems)
        _no_double(raw, seen, place, "scenario", problems)
        scenarios.append(_scenario(table, ground, place, problems) if table else None)
    return scenarios


def _scenario(table: ScenarioTable, ground: Floor | None, place: Place, problems: Problems) -> Scenario | None:
    for number, (x, y, _) in enumerate(table.poses):
        if not (0 <= x <= WIDTH and 0 <= y <= HEIGHT):
            problems.add(
                (*place, "poses", number),
                f"poses[{number}] is off the floor, expected x from 0 to {WIDTH} and y from 0 to {HEIGHT}",
            )
    poses = tuple(Pose(*pose) for pose in table.poses)
    if not poses:
        poses = (ground.default_pose if ground else Pose(100, 800, 0),)
    return Scenario(
        id=table.id,
        poses=poses,
        title=table.title,
        choose=table.choose,
        trials=table.trials,
        seconds=table.seconds,
        light_noise=table.light_noise,
        motor_noise=table.motor_noise,
        channel=Channel(**table.channel.model_dump()),
        visibility=table.visibility,
        start_jitter=table.start_jitter,
        sweep=Sweep(**table.sweep.model_dump()),
    )


def _criteria(
    document: Mapping[str, object],
    scenarios: Sequence[Scenario | None],
    ground: Floor | None,
    parts: PartsTable | None,
    aliases: Mapping[str, tuple[str, ...]],
    files: Files,
    problems: Problems,
) -> tuple[Criterion, ...]:
    criteria: list[Criterion] = []
    seen: dict[str, int] = {}
    scenario_ids = _texts([raw.get("id") for raw in _list_of_tables(document.get("scenario"))])
    for number, raw in enumerate(_tables_of(document, "criterion", problems)):
        place = ("criterion", number)
        check = raw.get("check")
        if check not in SCHEMAS:
            hint = did_you_mean(check, SCHEMAS) if isinstance(check, str) else ""
            said = f'check is "{str(check)[:60]}"' if "check" in raw else "check is missing"
            problems.add((*place, "check"), f"{said}, expected {listed(SCHEMAS)}{hint}")
            continue
        criterion = _table(SCHEMAS[cast(str, check)], raw, place, problems)
        for key in _LISTS_OF_TEXTS & {key for key, value in raw.items() if value == []}:
            problems.add((*place, key), f"{key} is an empty list and asks for nothing, expected at least one text")
        for index, name in enumerate(_texts(raw.get("scenarios"))):
            if name not in scenario_ids:
                problems.add(
                    (*place, "scenarios", index),
                    f'scenarios names "{name[:60]}", expected the id of a scenario{did_you_mean(name, scenario_ids)}',
                )
        if criterion is None:
            continue
        named = criterion.model_copy(update={"id": criterion.id or _slug(criterion.title)})
        if isinstance(named, Recognition):
            named = completed(named, aliases, files, place, problems)
        _no_double({"id": named.id}, seen, place, "criterion", problems)
        _check_criterion(cast(Criterion, named), scenarios, ground, parts, place, problems)
        check_code(cast(Criterion, named), parts, runs_no_robot(document), files, place, problems)
        criteria.append(cast(Criterion, named))
    return tuple(criteria)


def _check_criterion(
    criterion: Criterion,
    scenarios: Sequence[Scenario | None],
    ground: Floor | None,
    parts: PartsTable | None,
    place: Place,
    problems: Problems,
) -> None:
    """What a criterion asks must be there: a responder, and what recognition needs."""
    needs_responder = isinstance(criterion, Recognition | Replies) or (
        isinstance(criterion, Messages) and (criterion.json_queue or criterion.queue_grows)
    )
    if needs_responder and parts is not None and parts.responder == "none":
        problems.add((*place, "check"), 'check needs a responder, but parts has responder = "none", expected one')
    if isinstance(criterion, Reports):
        check_reports(criterion, scenarios, place, problems)
    if isinstance(criterion, Recognition):
        check_recognition(criterion, scenarios, ground, place, problems)


def _given_parts(parts: PartsTable, robotless: bool, files: Files, problems: Problems) -> dict[str, str]:
    sources = {}
    for part in ("program", "responder"):
        name = getattr(parts, part)
        if name in ("student", "none"):
            continue
        if part == "responder" and name not in files and name in library.names():
            sources[name] = library.source(name)
            continue
        if name not in files or not name.endswith(".py"):
            none = "" if part == "program" else f', "none", {", ".join(library.names())}'
            problems.add(
                ("parts", part), f'{part} is "{name[:60]}", expected "student"{none} or a .py file beside this file'
            )
            continue
        try:
            sources[name] = decode_source(files[name], name).text
        except UsageError as error:
            problems.add(("parts", part), str(error).rstrip("."))
    if parts.program == "none" and not robotless:
        problems.add(
            ("parts", "program"), 'program is "none", expected "student" or a .py file: a trial runs a program'
        )
    return sources


def _given(document: Mapping[str, object], files: Files, problems: Problems) -> dict[str, bytes]:
    given = {}
    for number, name in enumerate(_texts(document.get("given"))):
        if name in files and "/" not in name:
            given[name] = files[name]
        else:
            problems.add(("given", number), f'given names "{name[:60]}", expected a file beside this file')
    models = document.get("given_models")
    for name, model in models.items() if isinstance(models, dict) else ():
        if not isinstance(model, str):
            continue
        place = ("given_models", name)
        data = packaged_model(model)
        if not re.fullmatch(r"[\w][\w.-]*", name):
            problems.add(place, f'given_models has the file name "{name[:60]}", expected letters, digits, ., - and _')
        elif name in given:
            problems.add(place, f'"{name}" is given twice, expected it in given or in given_models')
        elif data is None:
            known = packaged_models()
            problems.add(
                place,
                f'"{model[:60]}" is no packaged model, expected {listed(known) if known else "one (there are none)"}'
                f"{did_you_mean(model, known)}",
            )
        else:
            given[name] = data
    return given


def packaged_models() -> tuple[str, ...]:
    """The names of the trained networks that come with Robomark: those of their cards."""
    folder = _weights_folder()
    return tuple(sorted(card.stem for card in folder.glob("*.json"))) if folder.is_dir() else ()


def packaged_model(name: str) -> bytes | None:
    """The bytes of a packaged network, to be loaded by student code inside the sandbox; None if there is none."""
    if name not in packaged_models():
        return None
    card = json.loads((_weights_folder() / f"{name}.json").read_text("utf-8"))
    return (_weights_folder() / str(card["file"])).read_bytes()


def _weights_folder() -> Path:
    return Path(str(resources.files("models"))) / "weights"


def _tables_of(document: Mapping[str, object], key: str, problems: Problems) -> list[dict[str, Any]]:
    value = document.get(key)
    if value is None or value == []:
        problems.add((), f"there is no [[{key}]], expected at least one")
    elif not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        problems.add((key,), f"{key} is not a list of tables, expected [[{key}]] before each")
    return _list_of_tables(value)


def _list_of_tables(value: object) -> list[dict[str, Any]]:
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def _texts(value: object) -> list[str]:
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []


def _no_double(raw: Mapping[str, object], seen: dict[str, int], place: Place, kind: str, problems: Problems) -> None:
    name = raw.get("id")
    if not isinstance(name, str):
        return
    if name in seen:
        problems.add((*place, "id"), f'id "{name[:60]}" is the id of an earlier {kind}, expected one of its own')
    seen[name] = seen.get(name, 0) + 1


def _slug(title: str) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60].strip("-")
    return words or "criterion"
