"""The number of SQL statements of each page and each API answer is limited, however much data there is.

They are counted on PostgreSQL, which gets the same statements as SQLite and is also asked for the time.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import event
from starlette.testclient import TestClient

from benchmarks.harness.postgresql_server import create_database
from crowded_world import crowd
from paths import DATA
from service.store.engine import Store
from service.store.grades import plots
from web import Web, web_in
from web_world import World, filled, make_world

MOST = 25
API = "/api/v1/"
_ROUTES = {
    route.removeprefix("GET "): who.split()[0]
    for table in sorted((DATA / "access").glob("*.toml"))
    for route, who in tomllib.loads(table.read_text()).items()
    if route.startswith("GET ")
}
#: The caller for each word in the tables.
_READERS = {
    "anybody": ("nobody",),
    "signed-in": ("ada", "grace", "root"),
    "student": ("ada",),
    "member": ("ada", "grace"),
    "owner": ("ada",),
    "instructor": ("grace",),
    "operator": ("root",),
}
#: Statements that begin a transaction, or set up a connection of SQLite.
_NO_STATEMENT = re.compile("BEGIN|PRAGMA")


@pytest.mark.long
def test_no_route_needs_many_statements_or_more_of_them_the_more_there_is(tmp_path: Path, postgresql: str) -> None:
    with web_in(tmp_path, database_url=create_database(postgresql)) as web:
        world = make_world(web)
        plots.store_plots(web.store, world.values["job_id"], {"path": b"PNG"})
        browsers, tokens = _sign_in(web, world)
        crowd(web, world, range(1))
        few = {each: _count(web.store, *each, browsers, tokens, world) for each in _all_asked()}
        crowd(web, world, range(1, 50))
        many = {each: _count(web.store, *each, browsers, tokens, world) for each in _all_asked()}
    assert {each: count for each, count in many.items() if count > MOST} == {}
    assert {each: (few[each], count) for each, count in many.items() if count > few[each]} == {}


def _all_asked() -> list[tuple[str, str]]:
    return [(route, who) for route, allowed in _ROUTES.items() for who in _READERS[allowed]]


def _sign_in(web: Web, world: World) -> tuple[dict[str, TestClient], dict[str, dict[str, str]]]:
    members = {"ada": world.ada, "grace": world.grace, "root": web.operator()}
    browsers = {"nobody": web.browser(), **{who: web.browser(member) for who, member in members.items()}}
    scopes = ("read", "submit", "mark", "manage", "sign-in")
    return browsers, {who: web.token(member, *scopes) for who, member in members.items()}


def _count(
    store: Store,
    route: str,
    who: str,
    browsers: dict[str, TestClient],
    tokens: dict[str, dict[str, str]],
    world: World,
) -> int:
    path = filled(route, world.values)
    with _counted(store) as statements:
        if route.startswith(API):
            answer = browsers["nobody"].get(path, headers=tokens.get(who, {}))
        else:
            answer = browsers[who].get(path)
    assert answer.status_code in (200, 303, 409, 410, 422, 503), (path, answer.text)
    return len(statements)


@contextmanager
def _counted(store: Store) -> Iterator[list[str]]:
    statements: list[str] = []

    def note(_connection: object, _cursor: object, statement: str, *_: object) -> None:
        if _NO_STATEMENT.match(statement) is None:
            statements.append(statement)

    event.listen(store.engine, "before_cursor_execute", note)
    try:
        yield statements
    finally:
        event.remove(store.engine, "before_cursor_execute", note)
