"""Every route with every kind of reader: ``tests/data/access`` lists who may use which.

A route without a table row fails the test, and so does a table row without a route.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Set
from dataclasses import dataclass, replace

import pytest
from fastapi.routing import iter_route_contexts
from httpx2 import Response
from starlette.testclient import TestClient

from paths import DATA
from service.web.rate_limits import RateLimits
from web import Web, csrf, web_in
from web_world import create_upload, filled, make_world

API = "/api/v1/"
Restore = Callable[[], None]
_TABLES = sorted((DATA / "access").glob("*.toml"))
ROUTES = {route: who for table in _TABLES for route, who in tomllib.loads(table.read_text()).items()}
#: Routes of forms on pages. Other sites may post only to routes marked for it, and programs have no forms.
_CHANGING = [
    route
    for route, who in ROUTES.items()
    if not route.startswith("GET ") and API not in route and not who.endswith(" cross-site")
]
READERS = ("nobody", "owner", "other student", "instructor", "other instructor", "operator")
#: The kinds of readers for each word in the tables.
ALLOWED = {
    "anybody": set(READERS),
    "signed-in": set(READERS) - {"nobody"},
    "instructor": {"instructor"},
    "student": {"owner", "other student"},
    "member": {"owner", "other student", "instructor"},
    "owner": {"owner"},
    "operator": {"operator"},
}


@dataclass(frozen=True, slots=True)
class Signed:
    """The credentials of each reader, and the values for the paths."""

    browsers: dict[str, TestClient]
    tokens: dict[str, dict[str, str]]
    words: dict[str, str]
    values: dict[str, str]


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Web, Signed, Restore]]:
    with web_in(tmp_path_factory.mktemp("home")) as web:
        world = make_world(web)
        members = {
            "owner": world.ada,
            "other student": web.student("bob"),
            "instructor": world.grace,
            "other instructor": web.instructor("mallory", "another course"),
            "operator": web.operator(),
        }
        browsers = {"nobody": web.browser(), **{who: web.browser(member) for who, member in members.items()}}
        words = {who: csrf(browser.get("/account")) for who, browser in browsers.items() if who != "nobody"}
        everything = ("read", "submit", "mark", "manage", "sign-in")
        tokens = {who: web.token(member, *everything) for who, member in members.items()}
        yield web, Signed(browsers, tokens, words, world.values), _snapshot(web, browsers.values())


@pytest.fixture
def signed(installation: tuple[Web, Signed, Restore]) -> tuple[Web, Signed]:
    """Return the installation as it was made. Routes remove people, credentials and assignments that others need."""
    web, signed_requests, restore = installation
    restore()
    return web, signed_requests


def _snapshot(web: Web, browsers: Iterable[TestClient]) -> Restore:
    """Return a function that restores the database, the cookies of the browsers, and the rate limits."""
    database = web.settings.home / "robomark.db"
    web.store.engine.dispose()
    data, cookies = database.read_bytes(), [(browser, list(browser.cookies.jar)) for browser in browsers]

    def restore() -> None:
        web.store.engine.dispose()
        database.write_bytes(data)
        web.app.state.context = replace(web.app.state.context, limits=RateLimits())
        for browser, kept in cookies:
            browser.cookies.clear()
            for cookie in kept:
                browser.cookies.jar.set_cookie(cookie)

    return restore


def _routes(web: Web) -> set[str]:
    return {
        f"{method} {route.path}"
        for route in iter_route_contexts(web.app.routes)
        for method in route.methods or ()
        if method != "HEAD"
    }


def test_every_route_is_in_a_table(signed: tuple[Web, Signed]) -> None:
    assert _routes(signed[0]) == set(ROUTES)


def test_programs_can_do_all_that_pages_do() -> None:
    served = {"/static/{name}", "/health/live", "/health/ready", "/metrics", "/api/openapi.json"}
    pages = {route for route in ROUTES if API not in route and route.partition(" ")[2] not in served}
    document = tomllib.loads((DATA / "page_to_api.toml").read_text())
    assert pages == set(document)
    does = {route.replace(API, "/", 1) for route in ROUTES if API in route}
    assert {each for each in document.values() if not each.startswith("none: ")} <= does


def _choose_readers(route: str) -> set[str]:
    """Return everybody who may use a route, nobody, and one of the others, a different kind for the next route."""
    allowed = ALLOWED[ROUTES[route].split(" ")[0]]
    others = [who for who in READERS if who not in {"nobody", *allowed}]
    number = sorted(ROUTES).index(route)
    return {"nobody", *allowed, *others[number % len(others) :][:1]} if others else set(READERS)


@pytest.mark.parametrize("route", sorted(ROUTES))
def test_who_may_come_near(signed: tuple[Web, Signed], route: str) -> None:
    _check_readers(signed, route, _choose_readers(route))


@pytest.mark.long
@pytest.mark.parametrize("route", sorted(route for route in ROUTES if set(READERS) > _choose_readers(route)))
def test_nobody_else_may_come_near(signed: tuple[Web, Signed], route: str) -> None:
    _check_readers(signed, route, set(READERS) - _choose_readers(route))


def _check_readers(signed: tuple[Web, Signed], route: str, readers: Set[str]) -> None:
    web, signed_requests = signed
    method, path = route.split(" ", 1)
    allowed = ALLOWED[ROUTES[route].split(" ")[0]]
    values = signed_requests.values
    if "{upload_id}" in path:  # the deletion of a student removes the waiting uploads of the course
        values = {**values, "upload_id": create_upload(web, web.instructor())}
    # Readers without permission first: the others could end the objects.
    for who in sorted(readers, key=lambda each: (each in allowed, READERS.index(each))):
        answer = _ask(signed_requests, who, method, filled(path, values))
        if who in allowed:
            assert answer.status_code not in (401, 404, 403, 500), (who, answer.status_code, answer.text[-2000:])
            assert not (answer.status_code == 303 and answer.headers["location"].startswith("/sign-in?")), who
        elif who != "nobody":
            assert answer.status_code == 404, (who, answer.status_code, answer.text[-2000:])
        elif path.startswith(API):
            assert answer.status_code == 401
        else:
            assert answer.status_code == 303, answer.text
            assert answer.headers["location"].startswith("/sign-in")


@pytest.mark.long
@pytest.mark.parametrize("route", sorted(route for route in ROUTES if API in route and " " in ROUTES[route]))
def test_a_token_without_the_scope_may_not(signed: tuple[Web, Signed], route: str) -> None:
    web, signed_requests = signed
    method, path = route.split(" ", 1)
    who, scope = ROUTES[route].split(" ")
    reader = {"signed-in": "owner", "student": "owner", "member": "owner"}.get(who, who)
    members = {"owner": web.student("ada"), "instructor": web.instructor(), "operator": web.operator()}
    token = web.token(members[reader], *({"read", "submit", "mark", "manage"} - {scope}))
    answer = signed_requests.browsers["nobody"].request(method, filled(path, signed_requests.values), headers=token)
    assert answer.status_code == 403, answer.text
    assert scope in answer.json()["detail"]


@pytest.mark.long
@pytest.mark.parametrize("route", sorted(_CHANGING))
def test_what_changes_something_asks_for_the_forms_word(signed: tuple[Web, Signed], route: str) -> None:
    """Only readers who may use the route: the others are refused with the word, too."""
    method, path = route.split(" ", 1)
    _, signed_requests = signed
    allowed = ALLOWED[ROUTES[route].split(" ")[0]]
    for who in signed_requests.words.keys() & allowed:
        answer = signed_requests.browsers[who].request(
            method, filled(path, signed_requests.values), data={"csrf": "0" * 64}
        )
        if path.startswith(API):
            # The API ignores cookies, so no other site can use them.
            assert answer.status_code == 401
            continue
        assert answer.status_code in (403, 404), (who, answer.status_code)
        other = {"sec-fetch-site": "cross-site", "x-csrf-token": signed_requests.words[who]}
        assert signed_requests.browsers[who].request(
            method, filled(path, signed_requests.values), headers=other
        ).status_code in (403, 404)


def _ask(signed_requests: Signed, who: str, method: str, path: str) -> Response:
    if path.startswith(API):
        return signed_requests.browsers["nobody"].request(method, path, headers=signed_requests.tokens.get(who, {}))
    headers = {"x-csrf-token": signed_requests.words[who]} if who in signed_requests.words else {}
    return signed_requests.browsers[who].request(method, path, headers=headers)
