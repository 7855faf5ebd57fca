"""The tables of an assignment file as they stand there, mistakes and all.

What is looked for in them is said by those who read them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from submissions.assignment.problems import Problems
from submissions.assignment.schema import read_table
from submissions.assignment.toml_lines import Path as Place

T = TypeVar("T", bound=BaseModel)


def checked_table(schema: type[T], table: object, place: Place, problems: Problems) -> T | None:
    """The table as the schema has it; None, and its mistakes in ``problems``, if it cannot be read."""
    result = read_table(schema, table)
    if isinstance(result, schema):
        return result
    for problem in cast(list[Any], result):
        problems.add((*place, *problem.path), problem.sentence)
    return None


def tables_of(document: Mapping[str, object], key: str, problems: Problems) -> list[dict[str, Any]]:
    """The tables of a list that must have at least one."""
    value = document.get(key)
    if value is None or value == []:
        problems.add((), f"there is no [[{key}]], expected at least one")
    elif not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        problems.add((key,), f"{key} is not a list of tables, expected [[{key}]] before each")
    return list_of_tables(value)


def list_of_tables(value: object) -> list[dict[str, Any]]:
    """The tables among what stands there."""
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def texts_in(value: object) -> list[str]:
    """The texts among what stands there."""
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []


def no_double(raw: Mapping[str, object], seen: dict[str, int], place: Place, kind: str, problems: Problems) -> None:
    """Names an id that an earlier table of that kind has."""
    name = raw.get("id")
    if not isinstance(name, str):
        return
    if name in seen:
        problems.add((*place, "id"), f'id "{name[:60]}" is the id of an earlier {kind}, expected one of its own')
    seen[name] = seen.get(name, 0) + 1
