"""Properties of every answer, and protection from every request: headers, names, bodies, other sites, error details."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import anyio
import pytest
from sqlalchemy.exc import OperationalError
from starlette import requests
from starlette.exceptions import HTTPException
from starlette.requests import cookie_parser

from service.settings import Settings, load_settings
from service.web.api_uploads import MAX_BATCH_BYTES
from service.web.listening_sockets import check_reach
from service.web.rate_limits import RateLimit
from service.web.server import build_server_config
from sim.errors import UsageError
from web import Web, csrf, submit, web_in


def test_pages_run_and_load_nothing_but_our_files_and_are_kept_nowhere(web: Web) -> None:
    browser = web.browser(web.instructor())
    for path in ("/account", "/sign-in", "/nonsense", "/static/nonsense", "/api/v1/nonsense"):
        headers = browser.get(path).headers
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["content-security-policy"].startswith("default-src 'none'; script-src 'self'")
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"
        assert headers["referrer-policy"] == "no-referrer"
        assert "server" not in headers
    page_text = browser.get("/account").text
    assert "<style" not in page_text
    assert " style=" not in page_text
    assert " onclick" not in page_text
    css = page_text.split('rel="stylesheet" href="')[1].split('"')[0]
    assert "immutable" in browser.get(css).headers["cache-control"]


_PROBES = ("/health/live", "/health/ready", "/metrics")


@pytest.mark.parametrize(
    "host",
    [
        "evil.example.org",
        "localhost.evil.example.org",
        "robomark.example.org:443@evil",
        "localhost:80@evil",
        "localhost:80:80",
        "localhost:evil",
        "[::1]:80@evil",
        "web",
        "10.0.0.1.evil",
    ],
)
def test_a_name_that_is_not_ours_is_refused(web: Web, host: str) -> None:
    answer = web.browser().get("/sign-in", headers={"host": host})
    assert answer.status_code == 400
    assert "<a" not in answer.text
    for path in _PROBES:
        answer = web.browser().get(path, headers={"host": host})
        assert (answer.status_code, len(answer.text) < 200) == (400, True)


@pytest.mark.parametrize("host", ["", "10.1.2.3", "10.1.2.3:8470", "[fd00::7]:8470", "localhost:8470", "127.0.0.1"])
def test_probes_ask_by_an_address_or_by_no_name(web: Web, host: str) -> None:
    for path in _PROBES:
        assert web.browser().get(path, headers={"host": host}).status_code in (200, 503)


def test_probes_ask_by_the_names_that_are_set(tmp_path: Path) -> None:
    with web_in(tmp_path, probe_hosts="Web, robomark.internal", public_url="https://robomark.example.org") as web:
        for host in ("web:8470", "robomark.internal", "robomark.example.org"):
            assert web.browser().get("/metrics", headers={"host": host}).status_code == 200
        assert web.browser().get("/sign-in", headers={"host": "web:8470"}).status_code == 400


_FROM_HERE = {"origin": "http://localhost"}
_FROM_ELSEWHERE = {"origin": "https://evil.example.org"}


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 303),
        (_FROM_HERE, 303),
        ({"origin": "https://localhost"}, 303),
        (_FROM_ELSEWHERE, 403),
        ({"origin": "null"}, 403),
        ({"origin": "http://localhost.evil.example.org"}, 403),
        ({"origin": "http://localhost:1"}, 403),
        ({"origin": ""}, 403),
        ({**_FROM_HERE, "sec-fetch-site": "cross-site"}, 403),
        ({**_FROM_HERE, "sec-fetch-site": "same-origin"}, 303),
    ],
)
def test_nobody_is_signed_in_from_another_site(web: Web, headers: dict[str, str], status: int) -> None:
    answer = web.browser().post("/sign-in", data={"secret": web.link(web.student())}, headers=headers)
    assert answer.status_code == status


def test_the_public_name_is_an_origin_of_ours(tmp_path: Path) -> None:
    with web_in(tmp_path, public_url="https://robomark.example.org") as web:
        for origin, status in (("https://robomark.example.org", 303), ("https://other.example.org", 403)):
            data = {"secret": web.link(web.student())}
            assert web.browser().post("/sign-in", data=data, headers={"origin": origin}).status_code == status


def test_pages_are_counted_for_each_person(tmp_path: Path) -> None:
    with web_in(tmp_path, api_calls_per_minute=5) as web:
        browser = web.browser(web.instructor())
        answers = [browser.get("/account").status_code for _ in range(8)]
        assert answers == [200] * 5 + [429] * 3
        assert web.browser(web.student()).get("/account").status_code == 200
        assert browser.get("/sign-in").status_code == 200


def _told_address(settings: Settings, forwarded: str) -> str:
    """Return the address that the application sees for a request from this machine."""
    seen: list[str] = []

    async def application(scope: Any, _receive: object, _send: object) -> None:
        seen.append(scope["client"][0])

    config = build_server_config(settings, application)
    config.load()
    scope = {
        "type": "http",
        "scheme": "http",
        "client": ("127.0.0.1", 5),
        "headers": [(b"x-forwarded-for", forwarded.encode()), (b"host", b"localhost")],
    }
    anyio.run(config.loaded_app, scope, None, None)
    return seen[0]


@pytest.mark.parametrize(
    ("trusted", "forwarded", "address"),
    [
        ("", "192.0.2.7", "127.0.0.1"),
        ("10.0.0.0/8", "192.0.2.7", "127.0.0.1"),
        ("127.0.0.1", "192.0.2.7", "192.0.2.7"),
        ("127.0.0.0/8", "1.2.3.4, 192.0.2.7", "192.0.2.7"),
        ("127.0.0.1, 10.0.0.0/8", "1.2.3.4, 192.0.2.7, 10.0.0.3", "192.0.2.7"),
    ],
)
def test_only_a_trusted_proxy_says_who_asks(tmp_path: Path, trusted: str, forwarded: str, address: str) -> None:
    assert _told_address(Settings(home=tmp_path, trusted_proxies=trusted), forwarded) == address


@pytest.mark.parametrize(
    ("name", "value"), [("trusted_proxies", "proxy"), ("probe_hosts", "a b"), ("probe_hosts", "a:1")]
)
def test_lists_of_hosts_are_checked(tmp_path: Path, name: str, value: str) -> None:
    with pytest.raises(UsageError, match=f"ROBOMARK_{name.upper()}"):
        load_settings(home=tmp_path, **{name: value})


def test_behind_tls_cookies_and_links_are_for_tls(tmp_path: Path) -> None:
    with web_in(tmp_path, public_url="https://robomark.example.org") as web:
        browser = web.browser()
        browser.base_url = "https://robomark.example.org"
        answer = browser.post("/sign-in", data={"secret": web.link(web.student())})
        assert answer.status_code == 303
        assert "Secure" in answer.headers["set-cookie"]
        assert answer.headers["strict-transport-security"]


@pytest.mark.parametrize(("path", "most"), [("/sign-in", 2**20), ("/courses/1/batches/uploads", MAX_BATCH_BYTES)])
def test_a_body_is_not_read_for_ever(web: Web, path: str, most: int) -> None:
    browser = web.browser(web.instructor())
    for length in (str(most + 1), "-1"):
        assert browser.post(path, headers={"content-length": length}, content=b"x").status_code == 413

    def endless() -> Iterator[bytes]:
        for _ in range(most // 2**20 + 2):
            yield b"x" * 2**20

    form = {"content-type": "application/x-www-form-urlencoded"}
    assert browser.post(path, headers=form, content=endless()).status_code == 413


def test_another_sites_form_changes_nothing(web: Web) -> None:
    browser = web.browser(web.instructor())
    data = {"name": "stolen", "scopes": "read", "word": "w", "csrf": csrf(browser.get("/account"))}
    for headers in ({"sec-fetch-site": "cross-site"}, {"sec-fetch-site": "same-site"}):
        assert browser.post("/account/tokens", data=data, headers=headers).status_code == 403
    other = csrf(web.browser(web.instructor("mallory")).get("/account"))
    for word in ("", "0" * 64, other, "\u2028"):
        assert browser.post("/account/tokens", data={**data, "csrf": word}).status_code == 403
    assert "stolen" not in browser.get("/account").text
    assert submit(browser, "/account/tokens", {"name": "own", "scopes": "read", "word": "w"}).status_code == 303


def test_only_cookies_without_quotation_marks_are_parsed(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unquoting a long cookie takes seconds in some versions of Python, and pages need no quoted cookie."""
    parsed = []

    def parse(header: str) -> dict[str, str]:
        parsed.append(header)
        return cookie_parser(header)

    monkeypatch.setattr(requests, "cookie_parser", parse)
    session = web.browser(web.instructor()).cookies["robomark"]
    quoted = '"' + '\\"' * 1000 + '"'
    cookies = f"a={quoted}; robomark={session};language = {quoted} ; language=de; b={quoted}"
    answer = web.browser().get("/account", headers={"cookie": cookies})
    assert answer.status_code == 200
    assert 'lang="de"' in answer.text
    for path in ("/", "/nonsense", "/sign-in", "/lti/login", "/sign-in/rml_wrong"):
        web.browser().get(path, headers={"cookie": cookies})
        web.browser().post(path, headers={"cookie": f"robomark={quoted}"})
    assert len(parsed) > 5
    assert not any('"' in header for header in parsed)


def test_our_own_faults_say_nothing_of_themselves(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    browser = web.browser(web.instructor(), raise_server_exceptions=False)
    surprises = [KeyError("secret detail"), OperationalError("SELECT secret", {}, Exception("secret detail"))]
    for surprise, status in zip(surprises, (500, 503), strict=True):

        def fail(*_: object, surprise: Exception = surprise) -> None:
            raise surprise

        with monkeypatch.context() as patched:
            patched.setattr("service.store.people.credentials.list_credentials", fail)
            answer = browser.get("/account")
        assert answer.status_code == status
        assert "secret" not in answer.text
        assert "Traceback" not in answer.text
        assert "minute" in answer.text


def test_hostile_names_are_shown_and_nothing_more(web: Web) -> None:
    name = "<script>alert(1)</script>\"' onload=x \u202egnp.exe"
    browser = web.browser(web.instructor())
    submit(browser, "/account/tokens", {"name": name, "scopes": "read", "word": "w"})
    page_text = browser.get("/account").text
    assert "<script>alert" not in page_text
    assert "\u202e" not in page_text
    assert "&lt;script&gt;" in page_text


def test_a_bucket_fills_with_time() -> None:
    at = [0.0]
    limit = RateLimit(burst=2, per_minute=60, clock=lambda: at[0])
    for who in ("a", "a", "b"):
        limit.spend(who)
    with pytest.raises(HTTPException):
        limit.spend("a")
    at[0] += 1.0
    limit.spend("a")


@pytest.mark.parametrize(
    ("host", "public_url", "is_refused"),
    [
        ("127.0.0.1", "", False),
        ("localhost", "", False),
        ("::1", "", False),
        ("0.0.0.0", "", True),
        ("::", "", True),
        ("0.0.0.0", "https://robomark.example.org", False),
    ],
)
def test_others_reach_it_only_when_that_was_said(host: str, public_url: str, is_refused: bool, tmp_path: Path) -> None:
    settings = Settings(home=tmp_path, public_url=public_url)
    if is_refused:
        with pytest.raises(UsageError, match=r"does not support TLS.*ROBOMARK_PUBLIC_URL"):
            check_reach(host, settings)
    else:
        check_reach(host, settings)
