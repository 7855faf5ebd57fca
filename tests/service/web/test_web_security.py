"""What every answer has and what no request gets: headers, names, bodies, other sites, errors without their causes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy.exc import OperationalError
from starlette.exceptions import HTTPException

from service.settings import Settings
from service.web.listening import check_reach
from service.web.rate_limits import RateLimit
from service.web.security import LARGEST_BODY
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
    shown = browser.get("/account").text
    assert "<style" not in shown
    assert " style=" not in shown
    assert " onclick" not in shown
    css = shown.split('rel="stylesheet" href="')[1].split('"')[0]
    assert "immutable" in browser.get(css).headers["cache-control"]


@pytest.mark.parametrize(
    "host", ["evil.example.org", "localhost.evil.example.org", "", "robomark.example.org:443@evil"]
)
def test_a_name_that_is_not_ours_is_refused(web: Web, host: str) -> None:
    answer = web.browser().get("/sign-in", headers={"host": host})
    assert answer.status_code == 400
    assert "<a" not in answer.text
    assert web.browser().get("/health/live", headers={"host": host}).status_code == 200


def test_behind_tls_cookies_and_links_are_for_tls(tmp_path: Path) -> None:
    with web_in(tmp_path, public_url="https://robomark.example.org") as web:
        browser = web.browser()
        browser.base_url = "https://robomark.example.org"
        answer = browser.post("/sign-in", data={"secret": web.link(web.student())})
        assert answer.status_code == 303
        assert "Secure" in answer.headers["set-cookie"]
        assert answer.headers["strict-transport-security"]


@pytest.mark.parametrize(("path", "most"), [("/sign-in", 2**20), ("/courses/1/batches/uploads", LARGEST_BODY)])
def test_a_body_is_not_read_for_ever(web: Web, path: str, most: int) -> None:
    browser = web.browser()
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


def test_our_own_faults_say_nothing_of_themselves(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    browser = web.browser(web.instructor(), raise_server_exceptions=False)
    surprises = [KeyError("secret detail"), OperationalError("SELECT secret", {}, Exception("secret detail"))]
    for surprise, status in zip(surprises, (500, 503), strict=True):

        def fail(*_: object, surprise: Exception = surprise) -> None:
            raise surprise

        with monkeypatch.context() as patched:
            patched.setattr("service.store.people.credentials.tokens", fail)
            answer = browser.get("/account")
        assert answer.status_code == status
        assert "secret" not in answer.text
        assert "Traceback" not in answer.text
        assert "minute" in answer.text


def test_hostile_names_are_shown_and_nothing_more(web: Web) -> None:
    name = "<script>alert(1)</script>\"' onload=x \u202egnp.exe"
    browser = web.browser(web.instructor())
    submit(browser, "/account/tokens", {"name": name, "scopes": "read", "word": "w"})
    shown = browser.get("/account").text
    assert "<script>alert" not in shown
    assert "\u202e" not in shown
    assert "&lt;script&gt;" in shown


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
        with pytest.raises(UsageError, match=r"speaks no TLS.*ROBOMARK_PUBLIC_URL"):
            check_reach(host, settings)
    else:
        check_reach(host, settings)
