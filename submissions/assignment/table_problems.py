"""Validation of one table of an assignment file, with a sentence and a path for each mistake."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from submissions.strict_table import Entries, TableMistake
from submissions.suggestions import join_with_or, suggest_name

T = TypeVar("T", bound=BaseModel)
#: Tags of the alternatives of a key that accepts a number or a table. Paths of mistakes leave them out.
NUMBER_TAG, TABLE_TAG = "(number)", "(table)"
#: Maximum number of mistakes reported per table, because comparing them takes quadratic time.
_MAX_PROBLEMS = 200


@dataclass(frozen=True, slots=True)
class TableProblem:
    """A mistake in a table: its path and a sentence."""

    path: tuple[str | int, ...]
    sentence: str


def read_table(schema: type[T], table: object) -> T | list[TableProblem]:
    """Validate a table with the schema. Return the model, or a list of all mistakes."""
    try:
        # Pydantic's JSON mode is strict about types, but accepts a list for a tuple.
        return schema.model_validate_json(json.dumps(table, default=_encode_foreign_value), strict=True)
    except ValidationError as error:
        errors = error.errors(include_url=False)[:_MAX_PROBLEMS]
        paths = [details["loc"] for details in errors]
        return [describe_problem(schema, details) for details in errors if not _is_consequence(details, paths)]


def _is_consequence(details: ErrorDetails, paths: list[tuple[str | int, ...]]) -> bool:
    """Return whether a list counts as too short only because its entries were rejected."""
    path = details["loc"]
    return details["type"] == "too_short" and any(
        len(other) > len(path) and other[: len(path)] == path for other in paths
    )


def _encode_foreign_value(value: object) -> dict[str, str]:
    """Convert dates and times, which no key accepts, to a table that no key accepts either."""
    return {"date": str(value)}


_TYPES: Mapping[str, str] = {
    "string_type": "a text in quotes",
    "float_type": "a number",
    "float_parsing": "a number",
    "decimal_type": "a number",
    "decimal_parsing": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
    "string_too_short": "a text that is not empty",
    "string_pattern_mismatch": "small letters, digits, - and _, beginning with a letter or digit",
}


def describe_problem(schema: type[BaseModel], details: ErrorDetails) -> TableProblem:
    """Convert a pydantic error to a sentence and its path in the table."""
    path = tuple(part for part in details["loc"] if part not in (NUMBER_TAG, TABLE_TAG))
    name = str(path[-1]) if path else ""
    context: Mapping[str, Any] = details.get("ctx", {})
    kind = details["type"]
    if kind == "extra_forbidden":
        return TableProblem(path, _describe_unknown_key(schema, path))
    if kind == "missing":
        if isinstance(path[-1], int):
            sentence = f"{_format_path(path[:-1])} has too few numbers{_describe_entries(schema, path)}"
            return TableProblem(path[:-1], sentence)
        return TableProblem(path[:-1], f"{name} is missing, expected {name} = ...")
    if kind in ("value_error", "assertion_error"):
        error = context["error"]
        keys = (error.key,) if isinstance(error, TableMistake) else ()
        return TableProblem((*path, *keys), f"{_format_path(path)} {error}")
    value = format_short(details["input"])
    if kind in _TYPES:
        return TableProblem(path, f"{_format_path(path)} is {value}, expected {_TYPES[kind]}")
    if kind == "literal_error":
        choices = str(context.get("expected", ""))
        hint = suggest_name(str(details["input"]), re.findall("'(.*?)'", choices))
        choices = choices.replace("'", '"')
        return TableProblem(path, f"{_format_path(path)} is {value}, expected {choices}{hint}")
    bounds = {"greater_than": ("gt", "more than"), "greater_than_equal": ("ge", "at least")}
    bounds |= {"less_than": ("lt", "less than"), "less_than_equal": ("le", "at most")}
    if kind in bounds:
        key, comparison = bounds[kind]
        return TableProblem(path, f"{_format_path(path)} is {value}, expected {comparison} {context[key]:g}")
    if kind == "decimal_max_places":
        return TableProblem(path, f"{_format_path(path)} is {value}, expected at most two decimal places")
    if kind == "too_short":
        return TableProblem(
            path, f"{_format_path(path)} has too few entries, expected at least {context['min_length']}"
        )
    if kind == "too_long":
        return TableProblem(path, f"{_format_path(path)} has too many numbers{_describe_entries(schema, path)}")
    if kind == "string_too_long":
        return TableProblem(
            path, f"{_format_path(path)} is too long, expected at most {context['max_length']} characters"
        )
    return TableProblem(path, f"{_format_path(path)} is {value}, but {details['msg'][:1].lower()}{details['msg'][1:]}")


def _describe_unknown_key(schema: type[BaseModel], path: tuple[str | int, ...]) -> str:
    for part in path[:-1]:
        field = _collect_fields(schema).get(str(part))
        schema = (_find_table_schema(field.annotation) if field else None) or schema
    known_keys = list(_collect_fields(schema))
    name = str(path[-1])
    hint = suggest_name(name, known_keys)
    return f'"{name[:60]}" is not a key of this table, expected {join_with_or(known_keys)}{hint}'


def _find_table_schema(annotation: object) -> type[BaseModel] | None:
    """Return the schema of the tables that a key accepts, single or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _find_table_schema(part))), None)


def _format_path(path: tuple[str | int, ...]) -> str:
    """Return the path as text: ``poses[2]``, ``channel.delay``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text or "this table"


def _describe_entries(schema: type[BaseModel], path: tuple[str | int, ...]) -> str:
    """Describe the entries of a list of fixed length, from the type of its key."""
    shape = None
    for key in path:
        field = _collect_fields(schema).get(str(key))
        if field is not None:
            shape = next((each for each in field.metadata if isinstance(each, Entries)), None) or _find_entries(
                field.annotation
            )
            schema = _find_table_schema(field.annotation) or schema
    return f", expected {shape.words}" if shape else ", expected another number of them"


def _find_entries(annotation: object) -> Entries | None:
    if isinstance(annotation, Entries):
        return annotation
    return next((found for part in get_args(annotation) if (found := _find_entries(part))), None)


def _collect_fields(schema: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in schema.model_fields.items()}


def format_short(value: object) -> str:
    """Return a value of the file as text of at most 60 characters."""
    if isinstance(value, dict) and value.keys() == _encode_foreign_value("").keys():
        return str(value["date"])
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."
