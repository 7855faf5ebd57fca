"""Request bodies: the callers whose bodies are read, the length limits, and the places where they are parsed."""

from __future__ import annotations

import json
import threading
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import anyio
import pytest
from fastapi.routing import iter_route_contexts
from starlette.testclient import TestClient

from paths import DATA
from service.store.people.membership import Member
from service.web import api_routes, request_bodies
from service.web.request_bodies import MAX_FORM_BYTES
from sim.readers.json_text import read_json
from web import Web, web_in
from web_world import filled, make_world

_TABLES = sorted((DATA / "access").glob("*.toml"))
ROUTES = {route: who for table in _TABLES for route, who in tomllib.loads(table.read_text()).items()}
_UNSAFE = [route for route in ROUTES if route.split()[0] not in ("GET", "HEAD")]
#: The length limit of an upload, for routes that declare one.
_UPLOADS = {
    "POST /api/v1/courses/{course_id}/assignments/uploads": 130,
    "POST /api/v1/courses/{course_id}/mine/notebook-runs/checks": 34,
    "POST /api/v1/courses/{course_id}/mine/submissions": 34,
    "POST /api/v1/courses/{course_id}/mine/tryouts": 34,
    "POST /api/v1/courses/{course_id}/playground": 34,
    "POST /api/v1/courses/{course_id}/batches": 200,
    "POST /api/v1/courses/{course_id}/batches/preflight": 200,
    "POST /api/v1/courses/{course_id}/batches/{batch_id}/worksheet": 11,
    "POST /courses/{course_id}/assignments/uploads": 130,
    "POST /courses/{course_id}/batches/uploads": 200,
    "POST /courses/{course_id}/batches/{batch_id}/worksheet": 11,
    "POST /courses/{course_id}/mine/{assignment}": 34,
    "POST /courses/{course_id}/mine/{assignment}/try": 34,
    "POST /courses/{course_id}/people/table": 11,
    "POST /courses/{course_id}/playground": 34,
}


@dataclass(frozen=True, slots=True)
class _Seen:
    """The result of a request, and the length of the body that was read."""

    status: int
    read: int


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Web, dict[str, str], dict[str, Member]]]:
    with web_in(tmp_path_factory.mktemp("home")) as web:
        made = make_world(web)
        operator = web.operator()
        yield web, made.values, {"instructor": made.grace, "owner": made.ada, "student": made.ada, "operator": operator}


def _request_route(web: Web, route: str, values: dict[str, str], headers: dict[str, str], megabytes: int) -> _Seen:
    """Send a body in pieces of a megabyte directly to the application, and count how much of it is read."""
    method, path = route.split()
    path = filled(path, values)
    read = 0
    status = 0

    async def receive() -> dict[str, Any]:
        nonlocal read
        read += 1
        return {"type": "http.request", "body": b"[" + b"1," * (2**19 - 1) + b"1", "more_body": read < megabytes}

    async def send(message: Any) -> None:
        nonlocal status
        status = message.get("status", status)

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": path,
        "raw_path": path.encode(),
        "query_string": b"",
        "root_path": "",
        "headers": [(name.encode(), value.encode()) for name, value in {"host": "localhost", **headers}.items()],
        "client": ("127.0.0.1", 1),
        "server": ("localhost", 80),
    }
    anyio.run(web.app, scope, receive, send)
    return _Seen(status, read)


def _signed(web: Web, route: str, members: dict[str, Member]) -> dict[str, str]:
    """Return the headers of a caller who may use the route."""
    who = ROUTES[route].split()[0]
    return _sign_in(web, members.get(who, members["owner"]), "/api/" in route)


@cache
def _sign_in(web: Web, member: Member, is_program: bool) -> dict[str, str]:
    """Return the headers of a member. Refused requests don't end the session, so one is enough for all routes."""
    if is_program:
        return web.token(member, "read", "submit", "mark", "manage")
    browser: TestClient = web.browser(member)
    return {"cookie": f"robomark={browser.cookies['robomark']}"}


@pytest.mark.long
@pytest.mark.parametrize("route", _UNSAFE)
def test_nothing_is_read_of_somebody_unknown(
    route: str, world: tuple[Web, dict[str, str], dict[str, Member]], monkeypatch: pytest.MonkeyPatch
) -> None:
    web, values, _ = world
    wrong = {"authorization": "Bearer rmt_wrong", "cookie": "robomark=rms_wrong"}
    for headers in ({}, wrong):
        seen = _request_route(web, route, values, {"content-type": _FORM, **headers}, 3)
        if ROUTES[route].split()[0] == "anybody":
            assert (seen.status, seen.read) == (413, 1)
        else:
            assert (seen.status, seen.read) == (401 if "/api/" in route else 303, 0)


_JSON, _FORM = "application/json", "application/x-www-form-urlencoded"


@pytest.mark.long
@pytest.mark.parametrize(
    ("route", "kind"),
    [
        *((route, _JSON if "/api/" in route else _FORM) for route in _UNSAFE),
        *(pytest.param(route, _FORM if "/api/" in route else _JSON, marks=pytest.mark.long) for route in _UNSAFE),
    ],
)
def test_two_megabytes_are_too_much_but_for_uploads(
    route: str, kind: str, world: tuple[Web, dict[str, str], dict[str, Member]], monkeypatch: pytest.MonkeyPatch
) -> None:
    web, values, members = world

    def never(*_: object, **__: object) -> None:
        pytest.fail("the body was parsed")

    monkeypatch.setattr(api_routes, "read_json", never)
    headers = {"content-type": kind, **_signed(web, route, members)}
    most = _UPLOADS.get(route, 1)
    long = {**headers, "content-length": str(most * 2**20 + 1)}
    assert _request_route(web, route, values, long, 3) == _Seen(413, 0)
    # A body without a declared length is read up to the limit, unless the route does not read bodies.
    if most == 1:
        seen = _request_route(web, route, values, headers, 3)
        assert seen.status == 413 or seen.read == 0


def test_only_these_routes_declare_an_upload(world: tuple[Web, dict[str, str], dict[str, Member]]) -> None:
    web = world[0]
    declared = {
        f"{method} {route.path}": upload.most // request_bodies.MEGABYTE
        for route in iter_route_contexts(web.app.routes)
        for method in route.methods or ()
        if (upload := getattr(route.endpoint, request_bodies._UPLOAD_ATTRIBUTE, None)) is not None
    }
    assert declared == _UPLOADS
    for route, operations in web.app.openapi()["paths"].items():
        for method, operation in operations.items():
            kinds = operation.get("requestBody", {}).get("content", {})
            is_upload = not kinds.keys() <= {"application/json"}
            assert (f"{method.upper()} {route}" in _UPLOADS) == is_upload, route


@pytest.mark.parametrize("route", [route for route in _UPLOADS if "/api/" not in route])
def test_nothing_is_read_of_an_upload_that_its_route_refuses(
    route: str, world: tuple[Web, dict[str, str], dict[str, Member]]
) -> None:
    web, values, members = world
    other = members[{"instructor": "owner", "member": "operator"}.get(ROUTES[route], "instructor")]
    browser = web.browser(other)
    headers = {"cookie": f"robomark={browser.cookies['robomark']}", "content-type": "multipart/form-data; boundary=x"}
    assert _request_route(web, route, values, headers, 3) == _Seen(404, 0)
    for number in ("9" * 30, "9" * 5000):
        assert _request_route(web, route, {**values, "course_id": number}, headers, 3) == _Seen(404, 0)


def test_json_is_parsed_in_another_thread_and_within_bounds(
    world: tuple[Web, dict[str, str], dict[str, Member]], monkeypatch: pytest.MonkeyPatch
) -> None:
    web, _, members = world
    threads: list[str] = []

    def read(body: bytes, *, max_values: int) -> object:
        threads.append(threading.current_thread().name)
        return api_real(body, max_values=max_values)

    api_real = read_json
    monkeypatch.setattr(api_routes, "read_json", read)
    token = web.token(members["operator"], "manage", "read")
    browser = web.browser()
    path = "/api/v1/operator/courses"
    for body in (b"[" * 400_000, b"[" + b"[]," * 200_000 + b"0]", b'{"a": "\xff"}'):
        answer = browser.post(path, headers={**token, "content-type": "application/json"}, content=body)
        assert answer.status_code == 422
        assert "cannot be read" in answer.json()["detail"]
    made = browser.post(path, headers=token, json={"course": "Made", "id": "noether"})
    assert made.status_code == 201, made.text
    again = {**token, "idempotency-key": "one"}
    assert browser.post(path, headers=again, content=json.dumps([[]] * 30_000), params={}).status_code == 422
    assert MAX_FORM_BYTES == 2**20
    assert threads
    assert not any("MainThread" in name or "asyncio" in name for name in threads)


@pytest.mark.long
@pytest.mark.parametrize("route", _UNSAFE)
def test_forms_in_another_charset_are_not_read(
    route: str, world: tuple[Web, dict[str, str], dict[str, Member]]
) -> None:
    web, values, members = world
    headers = {"content-type": "Multipart/Form-Data; boundary=x; charset=punycode"}
    if ROUTES[route].split()[0] != "anybody":
        headers |= _signed(web, route, members)
    assert _request_route(web, route, values, headers, 1) == _Seen(415, 0)


@pytest.mark.parametrize("charset", ['"idna"', "unicode_escape", "utf-7", "utf-16", "latin-1", "utf-8; charset=idna"])
def test_forms_in_any_other_charset_are_not_read(
    charset: str, world: tuple[Web, dict[str, str], dict[str, Member]]
) -> None:
    headers = {"content-type": f"multipart/form-data; boundary=x; charset={charset}"}
    assert _request_route(world[0], "POST /language", {}, headers, 1) == _Seen(415, 0)


@pytest.mark.parametrize("charset", ["", "; charset=UTF-8", '; charset="utf-8"'])
def test_forms_in_utf8_are_read(charset: str, world: tuple[Web, dict[str, str], dict[str, Member]]) -> None:
    headers = {"content-type": f"multipart/form-data; boundary=x{charset}"}
    body = b'--x\r\ncontent-disposition: form-data; name="code"\r\n\r\nde\r\n--x--\r\n'
    assert world[0].browser().post("/language", content=body, headers=headers).status_code == 303
