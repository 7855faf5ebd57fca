"""Every page and API route with values that nobody sends, in path, query and form: none causes a server error."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import quote

import pytest
from fastapi.routing import iter_route_contexts

from service.operations.scopes import SCOPES
from service.settings import Settings
from web import Web, csrf, web_in
from web_world import World, filled, make_world

#: PostgreSQL accepts no NUL in text and no integer beyond 32 bits, SQLite none beyond 64. A raised 2 counts as a digit.
#: Each value is sent where the database may make a difference; what a database accepts is tested with the other one.
_VALUES: Mapping[str, tuple[str, ...]] = {
    "sqlite": ("\0", "\u00b2", str(2**63)),
    "postgresql": ("\0", str(2**31), str(2**63)),
}
_NOT_PAGES = ("/api", "/static", "/health", "/metrics")
#: These sign out the browser that sends them.
_ENDS_SESSION = ("/sign-out", "/account/end-others")
_VALID = {"assignment": "echo-responder", "course": "default", "reason": "because"}


pytestmark = pytest.mark.long


@pytest.fixture
def served_world(service_settings: Settings) -> Iterator[tuple[Web, World]]:
    changes = {"database_url": service_settings.database_url, "api_calls_per_minute": 1_000_000}
    with web_in(service_settings.home, **changes) as web:
        yield web, make_world(web)


def test_no_page_fails_by_an_unusual_value(served_world: tuple[Web, World]) -> None:
    web, world = served_world
    unusual = _VALUES[web.store.engine.dialect.name]
    browsers = {
        who: web.browser(member, raise_server_exceptions=False)
        for who, member in (("student", world.ada), ("instructor", world.grace), ("operator", web.operator()))
    }
    words = {who: {"x-csrf-token": csrf(browser.get("/account"))} for who, browser in browsers.items()}
    failed = set()
    for route in iter_route_contexts(web.app.routes):
        path = route.path or ""
        if path.startswith((*_NOT_PAGES, *_ENDS_SESSION)):
            continue
        who = _reader(path)
        for method in (route.methods or set()) - {"HEAD"}:
            for name, address, form in _requests(route, path, world.values, unusual):
                answer = browsers[who].request(method, address, data=form or None, headers=words[who])
                if answer.status_code >= 500:
                    failed.add((method, path, name))
    assert failed == set()


def test_no_route_of_the_api_fails_by_an_unusual_value(served_world: tuple[Web, World]) -> None:
    web, world = served_world
    unusual = _VALUES[web.store.engine.dialect.name]
    members = {"student": world.ada, "instructor": world.grace, "operator": web.operator()}
    tokens = {who: web.token(member, *SCOPES) for who, member in members.items()}
    browser = web.browser(raise_server_exceptions=False)
    failed = set()
    for route in iter_route_contexts(web.app.routes):
        path = route.path or ""
        if not path.startswith("/api/v1/"):
            continue
        who = _reader(path.removeprefix("/api/v1"))
        for method in (route.methods or set()) - {"HEAD"}:
            # Bodies are JSON here, which is not varied: each address is requested once.
            addresses = {address: name for name, address, _ in _requests(route, path, world.values, unusual)}
            for address, name in addresses.items():
                if browser.request(method, address, headers=tokens[who]).status_code >= 500:
                    failed.add((method, path, name))
    assert failed == set()


def _reader(path: str) -> str:
    """Return a reader who may open a page, so that the values reach the store."""
    if path.startswith("/operator"):
        return "operator"
    return "student" if "/mine" in path or path.startswith(("/account", "/me")) else "instructor"


def _requests(
    route: Any, path: str, values: dict[str, str], unusual: tuple[str, ...]
) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Yield the varied field, the address and the form of each request. All values but one are valid."""
    names = re.findall(r"\{(\w+)", path)
    for name in names:
        for value in unusual:
            yield name, filled(path, {**values, name: quote(value, safe="")}), {}
    dependant = getattr(route, "dependant", None)
    if dependant is None:
        return
    address, form = filled(path, values), [field.alias for field in dependant.body_params]
    valid = {name: _VALID.get(name, values.get(name, "1")) for name in form}
    for value in unusual:
        for field in dependant.query_params:
            yield field.alias, f"{address}?{field.alias}={quote(value, safe='')}", {}
        for name in form:
            yield name, address, {**valid, name: value}
