"""Reader of the ``[[criterion]]`` tables, which checks criteria against the rest of the assignment.

Each criterion's schema defines its keys and requirements. This module does not depend on single kinds of criteria.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from sim.errors import UsageError
from submissions.assignment.problems import Path as Place
from submissions.assignment.problems import Problems, checked_table, list_of_tables, no_double, tables_of, texts_in
from submissions.criteria import SCHEMAS, Criterion
from submissions.criteria.common import HOLDS_ANSWERS, NOT_EMPTY, Misfit, Surroundings
from submissions.nearest import did_you_mean, listed
from submissions.source_text import decode_source

_WITHOUT_ROBOT = tuple(check for check, schema in SCHEMAS.items() if not schema.judges_runs)


def read_criteria(
    document: Mapping[str, object], around: Surroundings, robotless: bool, problems: Problems
) -> tuple[Criterion, ...]:
    """Return the criteria without mistakes; ``robotless`` marks an assignment in which no robot drives."""
    read: dict[Place, Criterion] = {}
    seen: dict[str, int] = {}
    scenarios = texts_in([raw.get("id") for raw in list_of_tables(document.get("scenario"))])
    for number, raw in enumerate(tables_of(document, "criterion", problems)):
        place: Place = ("criterion", number)
        criterion = _criterion(raw, place, problems)
        for index, name in enumerate(texts_in(raw.get("scenarios"))):
            if name not in scenarios:
                problems.add(
                    (*place, "scenarios", index),
                    f'scenarios names "{name[:60]}", expected the id of a scenario{did_you_mean(name, scenarios)}',
                )
        if criterion is None:
            continue
        try:
            criterion = criterion.completed(around)
        except Misfit as misfit:
            problems.add((*place, misfit.key), misfit.sentence)
        no_double({"id": criterion.id}, seen, place, "criterion", problems)
        read[place] = criterion
    around = replace(around, criteria=tuple(read.values()))
    for place, criterion in read.items():
        for found in (*_without_a_part(criterion, around, robotless), *criterion.misfits(around)):
            problems.add((*place, found.key), found.sentence)
    return tuple(read.values())


def check_given(document: Mapping[str, object], problems: Problems) -> None:
    """Report given files that contain answers: files of criteria, and the assignment's own description."""
    answers = {"assignment.toml", "expected.toml"}
    for raw in list_of_tables(document.get("criterion")):
        schema = SCHEMAS.get(str(raw.get("check")))
        answers |= {str(raw[key]) for key in _marked(schema, HOLDS_ANSWERS) if key in raw} if schema else set()
    for number, name in enumerate(texts_in(document.get("given"))):
        if name in answers:
            problems.add(
                ("given", number),
                f'given names "{name[:60]}", which contains answers, expected a file that students may read',
            )


def sources_of(criteria: Iterable[Criterion], files: Mapping[str, bytes], problems: Problems) -> dict[str, str]:
    """Return the source of the instructor's Python checks by file name."""
    sources = {}
    for name in (name for criterion in criteria for name in criterion.python_files if name in files):
        try:
            sources[name] = decode_source(files[name], name).text
        except UsageError as error:
            problems.add(("criterion",), str(error).rstrip("."))
    return sources


def _criterion(raw: Mapping[str, Any], place: Place, problems: Problems) -> Criterion | None:
    check = raw.get("check")
    if not isinstance(check, str) or check not in SCHEMAS:
        hint = did_you_mean(check, SCHEMAS) if isinstance(check, str) else ""
        said = f'check is "{str(check)[:60]}"' if "check" in raw else "check is missing"
        problems.add((*place, "check"), f"{said}, expected {listed(SCHEMAS)}{hint}")
        return None
    schema = SCHEMAS[check]
    criterion = checked_table(schema, raw, place, problems)
    for key in sorted(_marked(schema, NOT_EMPTY)):
        if raw.get(key) == []:
            problems.add((*place, key), f"{key} is an empty list and has no condition, expected at least one text")
    return criterion and criterion.model_copy(update={"id": criterion.id or _slug(criterion.title)})


def _marked(schema: type[Criterion], mark: str) -> set[str]:
    return {name for name, key in schema.model_fields.items() if mark in key.metadata}


def _without_a_part(criterion: Criterion, around: Surroundings, robotless: bool) -> Iterator[Misfit]:
    """Yield the parts that the criterion needs and the assignment lacks: a run, a second robot or a responder."""
    if criterion.robot > around.robots:
        yield Misfit("robot", "robot is 2, but there is only one robot, expected robots = 2 in world")
    if criterion.robot > 1 and not criterion.judges_runs:
        yield Misfit("robot", "robot is 2, but check uses no run, expected it without robot")
    if criterion.asks_responder and "responder" in around.without:
        yield Misfit("check", 'check needs a responder, but parts has responder = "none", expected one')
    if robotless and criterion.judges_runs:
        yield Misfit(
            "check",
            'check judges a run of the robot, but there is no scenario and parts has program = "none", '
            f"expected {listed(_WITHOUT_ROBOT)}",
        )


def _slug(title: str) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60].strip("-")
    return words or "criterion"
