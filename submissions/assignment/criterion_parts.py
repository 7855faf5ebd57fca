"""Reader of the ``[[criterion]]`` tables, which checks criteria against the rest of the assignment.

Each criterion's schema defines its keys and requirements. This module does not depend on single kinds of criteria.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from sim.errors import UsageError
from submissions.assignment.pools import find_pool_mistakes
from submissions.assignment.problems import Path as Place
from submissions.assignment.problems import (
    Problems,
    check_table,
    check_unique_id,
    filter_tables,
    filter_texts,
    read_tables,
)
from submissions.criteria import SCHEMAS, Criterion
from submissions.criteria.common import HOLDS_ANSWERS, NOT_EMPTY, AssignmentContext, UnmetRequirement
from submissions.source_text import decode_source
from submissions.suggestions import join_with_or, suggest_name

_WITHOUT_ROBOT = tuple(check for check, schema in SCHEMAS.items() if not schema.judges_runs)


def read_criteria(
    document: Mapping[str, object], context: AssignmentContext, is_robotless: bool, problems: Problems
) -> tuple[Criterion, ...]:
    """Return the criteria without mistakes; ``is_robotless`` marks an assignment in which no robot drives."""
    criteria: dict[Place, Criterion] = {}
    id_counts: dict[str, int] = {}
    scenarios = filter_texts([raw.get("id") for raw in filter_tables(document.get("scenario"))])
    for number, raw in enumerate(read_tables(document, "criterion", problems)):
        table_path: Place = ("criterion", number)
        criterion = _build_criterion(raw, table_path, problems)
        for index, name in enumerate(filter_texts(raw.get("scenarios"))):
            if name not in scenarios:
                problems.add(
                    (*table_path, "scenarios", index),
                    f'scenarios names "{name[:60]}", expected the id of a scenario{suggest_name(name, scenarios)}',
                )
        if criterion is None:
            continue
        try:
            criterion = criterion.complete_from(context)
        except UnmetRequirement as requirement_error:
            problems.add((*table_path, requirement_error.key), requirement_error.sentence)
        check_unique_id({"id": criterion.id}, id_counts, table_path, "criterion", problems)
        criteria[table_path] = criterion
    context = replace(context, criteria=tuple(criteria.values()))
    for table_path, criterion in criteria.items():
        for requirement in (
            *_find_missing_parts(criterion, context, is_robotless),
            *_find_needs_mistakes(criterion, context),
            *criterion.find_unmet_requirements(context),
            *find_pool_mistakes(criterion, context),
        ):
            problems.add((*table_path, requirement.key), requirement.sentence)
    return tuple(criteria.values())


def check_given_files(document: Mapping[str, object], problems: Problems) -> None:
    """Report given files that contain answers: files of criteria, and the assignment's own description."""
    answers = {"assignment.toml", "expected.toml", "survivors.toml"}
    for raw in filter_tables(document.get("criterion")):
        schema = SCHEMAS.get(str(raw.get("check")))
        answers |= (
            {str(raw[key]) for key in _find_marked_keys(schema, HOLDS_ANSWERS) if key in raw} if schema else set()
        )
    for number, name in enumerate(filter_texts(document.get("given"))):
        if name in answers:
            problems.add(
                ("given", number),
                f'given names "{name[:60]}", which contains answers, expected a file that students may read',
            )


def read_check_sources(criteria: Iterable[Criterion], files: Mapping[str, bytes], problems: Problems) -> dict[str, str]:
    """Return the source of the instructor's Python checks by file name."""
    sources = {}
    for name in (name for criterion in criteria for name in criterion.python_files if name in files):
        try:
            sources[name] = decode_source(files[name], name).text
        except UsageError as error:
            problems.add(("criterion",), str(error).rstrip("."))
    return sources


def _build_criterion(raw: Mapping[str, Any], table_path: Place, problems: Problems) -> Criterion | None:
    check = raw.get("check")
    if not isinstance(check, str) or check not in SCHEMAS:
        hint = suggest_name(check, SCHEMAS) if isinstance(check, str) else ""
        statement = f'check is "{str(check)[:60]}"' if "check" in raw else "check is missing"
        problems.add((*table_path, "check"), f"{statement}, expected {join_with_or(SCHEMAS)}{hint}")
        return None
    schema = SCHEMAS[check]
    criterion = check_table(schema, raw, table_path, problems)
    for key in sorted(_find_marked_keys(schema, NOT_EMPTY)):
        if raw.get(key) == []:
            problems.add((*table_path, key), f"{key} is an empty list and has no condition, expected at least one text")
    return criterion and criterion.model_copy(update={"id": criterion.id or _make_slug(criterion.title)})


def _find_marked_keys(schema: type[Criterion], mark: str) -> set[str]:
    return {name for name, key in schema.model_fields.items() if mark in key.metadata}


def _find_missing_parts(
    criterion: Criterion, context: AssignmentContext, is_robotless: bool
) -> Iterator[UnmetRequirement]:
    """Yield the parts that the criterion needs and the assignment lacks: a run, a second robot or a responder."""
    if criterion.robot > context.robots:
        yield UnmetRequirement("robot", "robot is 2, but there is only one robot, expected robots = 2 in world")
    if criterion.robot > 1 and not criterion.judges_runs:
        yield UnmetRequirement("robot", "robot is 2, but check uses no run, expected it without robot")
    if criterion.asks_responder and "responder" in context.without:
        yield UnmetRequirement("check", 'check needs a responder, but parts has responder = "none", expected one')
    if is_robotless and criterion.judges_runs:
        yield UnmetRequirement(
            "check",
            'check judges a run of the robot, but there is no scenario and parts has program = "none", '
            f"expected {join_with_or(_WITHOUT_ROBOT)}",
        )


def _find_needs_mistakes(criterion: Criterion, context: AssignmentContext) -> Iterator[UnmetRequirement]:
    """Yield why the criterion cannot need another: that one must exist, give marks, and be no secret nor need it."""
    if criterion.needs is None:
        return
    if criterion.result_needed != criterion.needs:
        yield UnmetRequirement("needs", "needs is not used with a ranking, which needs the criterion that it ranks")
        return
    criteria_by_id = {each.id: each for each in context.criteria if each.marks and each.id != criterion.id}
    needed_criterion = criteria_by_id.get(criterion.needs)
    if needed_criterion is None:
        hint = suggest_name(criterion.needs, criteria_by_id)
        yield UnmetRequirement(
            "needs", f'needs is "{criterion.needs[:60]}", expected the id of another criterion with marks{hint}'
        )
        return
    if needed_criterion.visibility not in ("visible", criterion.visibility):
        # The lost marks would reveal the result.
        yield UnmetRequirement(
            "needs", f'needs is "{criterion.needs}", which students do not see, expected one with the same visibility'
        )
    needed_ids = {each.id: each.result_needed for each in context.criteria}
    name: str | None = criterion.needs
    for _ in needed_ids:
        name = needed_ids.get(name) if name is not None else None
    if name is not None:
        yield UnmetRequirement("needs", f'needs is "{criterion.needs}", which leads in a circle, expected none')


def _make_slug(title: str) -> str:
    slug = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60].strip("-")
    return slug or "criterion"
