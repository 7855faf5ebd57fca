"""The part of the API that programs rely on: the parameters and results of each route, without descriptions.

Run ``python tests/helpers/api_contract.py`` to record the contract of the current code for the next release.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from paths import DATA

RECORDED = DATA / "api_contract.json"
#: Maps a place in a request or response to its types. A ``?`` marks an optional value.
Shape = Mapping[str, str]
Contract = Mapping[str, Mapping[str, Shape]]
_METHODS = ("get", "post", "put", "patch", "delete")
#: Keys that all operations of a route share.
_ERRORS = {"400", "401", "403", "404", "409", "413", "415", "422", "429", "503"}


def contract_of(description: Mapping[str, Any]) -> Contract:
    """Return the contract for an OpenAPI description."""
    schemas = description.get("components", {}).get("schemas", {})
    return {
        f"{method.upper()} {path}": {
            "takes": dict(sorted(_taken(operation, schemas))),
            "gives": dict(sorted(_given(operation, schemas))),
        }
        for path, operations in sorted(description["paths"].items())
        for method, operation in sorted(operations.items())
        if method in _METHODS
    }


def breaking_changes(before: Contract, now: Contract) -> list[str]:
    """Return the parts of contract ``before`` that a program can no longer rely on in contract ``now``."""
    changes = [f"{route} is gone" for route in before if route not in now]
    for route in before.keys() & now.keys():
        changes += [f"{route} {change}" for change in _stricter(before[route]["takes"], now[route]["takes"])]
        changes += [f"{route} {change}" for change in _looser(before[route]["gives"], now[route]["gives"])]
    return sorted(changes)


def _stricter(before: Shape, now: Shape) -> Iterator[str]:
    for place in before.keys() | now.keys():
        if place not in now:
            yield f"does not take {place} any more"
        elif place not in before:
            if not _optional(now[place]):
                yield f"needs {place}"
        elif _types(before[place]) - _types(now[place]):
            yield f"takes {place} as {now[place]}, not {before[place]}"
        elif _optional(before[place]) and not _optional(now[place]):
            yield f"needs {place}"


def _looser(before: Shape, now: Shape) -> Iterator[str]:
    for place, types in before.items():
        if place not in now:
            yield f"does not give {place} any more"
        elif _types(now[place]) - _types(types):
            yield f"gives {place} as {now[place]}, not {types}"
        elif _optional(now[place]) and not _optional(types):
            yield f"does not always give {place}"


def _optional(written: str) -> bool:
    return written.endswith("?")


def _types(written: str) -> set[str]:
    return set(written.removesuffix("?").split("|"))


def _taken(operation: Mapping[str, Any], schemas: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for each in operation.get("parameters", ()):
        optional = "" if each.get("required") else "?"
        yield from _places(each["schema"], schemas, f"{each['in']}.{each['name']}", optional)
    body = operation.get("requestBody", {})
    for kind, content in body.get("content", {}).items():
        yield from _places(content.get("schema", {}), schemas, kind, "" if body.get("required") else "?")


def _given(operation: Mapping[str, Any], schemas: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for status, answer in operation.get("responses", {}).items():
        if status in _ERRORS:
            continue
        yield status, "answer"
        for content in answer.get("content", {}).values():
            yield from _places(content.get("schema", {}), schemas, status, "")


def _places(
    schema: Mapping[str, Any], schemas: Mapping[str, Any], where: str, optional: str, inside: tuple[str, ...] = ()
) -> Iterator[tuple[str, str]]:
    """Yield each value below a schema with its place. A recursive schema is followed once."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        if name not in inside:
            yield from _places(schemas[name], schemas, where, optional, (*inside, name))
        return
    alternatives = [*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())]
    if alternatives:
        kinds = [_kind(each, schemas) for each in alternatives]
        yield where, "|".join(sorted(set(kinds))) + optional
        for each in alternatives:
            if _kind(each, schemas) in ("object", "array"):
                yield from list(_places(each, schemas, where, optional, inside))[1:]
        return
    yield where, _kind(schema, schemas) + optional
    for name, inner in schema.get("properties", {}).items():
        left_out = "" if name in schema.get("required", ()) else "?"
        yield from _places(inner, schemas, f"{where}.{name}", left_out, inside)
    if isinstance(schema.get("items"), Mapping):
        yield from _places(schema["items"], schemas, f"{where}[]", "", inside)


def _kind(schema: Mapping[str, Any], schemas: Mapping[str, Any]) -> str:
    if "$ref" in schema:
        return _kind(schemas[schema["$ref"].rpartition("/")[2]], schemas)
    if "enum" in schema:
        return "|".join(sorted(f"={value}" for value in schema["enum"]))
    if "const" in schema:
        return f"={schema['const']}"
    kind = schema.get("type", "any")
    return "|".join(sorted(kind)) if isinstance(kind, list) else str(kind)


def current() -> Contract:
    """Return the contract of the current code."""
    from web import web_in

    with tempfile.TemporaryDirectory() as folder, web_in(Path(folder)) as web:
        return contract_of(web.app.openapi())


if __name__ == "__main__":
    RECORDED.write_text(json.dumps(current(), indent=1, sort_keys=True) + "\n")
