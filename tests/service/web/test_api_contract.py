"""Programs written for the recorded API contract still work, and breaking changes are detected."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

import pytest

from api_contract import RECORDED, breaking_changes, contract_of, current

ROUTE = "/courses/{course_id}/batches"
DESCRIPTION: dict[str, Any] = {
    "paths": {
        ROUTE: {
            "post": {
                "parameters": [
                    {"name": "course_id", "in": "path", "required": True, "schema": {"type": "integer"}},
                    {"name": "limit", "in": "query", "schema": {"type": "integer"}},
                ],
                "requestBody": {
                    "required": True,
                    "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Asked"}}},
                },
                "responses": {
                    "201": {"content": {"application/json": {"schema": {"$ref": "#/components/schemas/Made"}}}},
                    "404": {"description": "as everywhere"},
                },
            }
        }
    },
    "components": {
        "schemas": {
            "Asked": {
                "type": "object",
                "required": ["name"],
                "properties": {"name": {"type": "string"}, "lane": {"enum": ["batch", "soon"]}},
            },
            "Made": {
                "type": "object",
                "required": ["id", "rows"],
                "properties": {
                    "id": {"type": "string"},
                    "marks": {"anyOf": [{"type": "number"}, {"type": "null"}]},
                    "rows": {"type": "array", "items": {"$ref": "#/components/schemas/Made"}},
                },
            },
        }
    },
}


def _post(description: dict[str, Any]) -> dict[str, Any]:
    return dict(description["paths"][ROUTE]["post"])


def _schema(description: dict[str, Any], name: str) -> dict[str, Any]:
    schema = description["components"]["schemas"][name]
    assert isinstance(schema, dict)
    return schema


BREAKING: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "a route goes": (lambda d: d["paths"].clear(), "is gone"),
    "a parameter goes": (lambda d: _post(d)["parameters"].pop(), "does not take query.limit any more"),
    "a parameter is needed": (lambda d: _post(d)["parameters"][1].update(required=True), "needs query.limit"),
    "a new parameter is needed": (
        lambda d: _post(d)["parameters"].append(
            {"name": "by", "in": "query", "required": True, "schema": {"type": "string"}}
        ),
        "needs query.by",
    ),
    "another type is taken": (
        lambda d: _post(d)["parameters"][1].update(schema={"type": "string"}),
        "takes query.limit as string?, not integer?",
    ),
    "a value is not taken": (
        lambda d: _schema(d, "Asked")["properties"].update(lane={"enum": ["batch"]}),
        "takes application/json.lane as =batch?, not =batch|=soon?",
    ),
    "a field is needed": (lambda d: _schema(d, "Asked")["required"].append("lane"), "needs application/json.lane"),
    "a field is not given": (lambda d: _schema(d, "Made")["properties"].pop("id"), "does not give 201.id any more"),
    "a field is given at times": (lambda d: _schema(d, "Made")["required"].remove("id"), "does not always give 201.id"),
    "another type is given": (
        lambda d: _schema(d, "Made")["properties"].update(id={"type": "integer"}),
        "gives 201.id as integer, not string",
    ),
    "nothing may be given": (
        lambda d: _schema(d, "Made")["properties"].update(id={"anyOf": [{"type": "string"}, {"type": "null"}]}),
        "gives 201.id as null|string, not string",
    ),
    "another status is answered": (
        lambda d: _post(d)["responses"].update({"202": _post(d)["responses"].pop("201")}),
        "does not give 201 any more",
    ),
}
HARMLESS: dict[str, Callable[[dict[str, Any]], object]] = {
    "a new route": lambda d: d["paths"].update({"/new": {"get": {"responses": {}}}}),
    "a parameter that may be left out": lambda d: _post(d)["parameters"].append(
        {"name": "by", "in": "query", "schema": {"type": "string"}}
    ),
    "a new field of an answer": lambda d: _schema(d, "Made")["properties"].update(at={"type": "string"}),
    "another value is taken": lambda d: _schema(d, "Asked")["properties"]["lane"]["enum"].append("later"),
    "a field may be left out": lambda d: _schema(d, "Asked").update(required=[]),
    "a type fewer is given": lambda d: _schema(d, "Made")["properties"].update(marks={"type": "number"}),
}


def test_nothing_that_programs_rely_on_has_changed() -> None:
    assert breaking_changes(json.loads(RECORDED.read_text()), current()) == []


@pytest.mark.parametrize("name", BREAKING)
def test_a_change_that_breaks_programs_is_found(name: str) -> None:
    change, expected_change = BREAKING[name]
    changed = copy.deepcopy(DESCRIPTION)
    change(changed)
    changes = breaking_changes(contract_of(DESCRIPTION), contract_of(changed))
    assert f"POST {ROUTE} {expected_change}" in changes, changes


@pytest.mark.parametrize("name", HARMLESS)
def test_a_change_that_breaks_nothing_is_none(name: str) -> None:
    changed = copy.deepcopy(DESCRIPTION)
    HARMLESS[name](changed)
    assert breaking_changes(contract_of(DESCRIPTION), contract_of(changed)) == []
