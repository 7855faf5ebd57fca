"""Times on pages include the server's time zone at that time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from browsing import chromium
from paths import ROOT
from service.web import rendering
from service.web.date_times import format_utc_offset, parse_date_time

SUMMER, WINTER = datetime(2026, 7, 1, 12, tzinfo=UTC), datetime(2026, 12, 1, 12, tzinfo=UTC)


@pytest.fixture
def server_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    with monkeypatch.context() as changed:
        yield changed
    time.tzset()


@pytest.mark.parametrize(
    ("zone", "summer", "winter"),
    [
        ("UTC", "UTC", "UTC"),
        ("Europe/Berlin", "UTC+2", "UTC+1"),
        ("America/St_Johns", "UTC-2:30", "UTC-3:30"),
        ("Asia/Kolkata", "UTC+5:30", "UTC+5:30"),
    ],
)
def test_a_moment_says_its_zone(server_in: pytest.MonkeyPatch, zone: str, summer: str, winter: str) -> None:
    server_in.setenv("TZ", zone)
    time.tzset()
    assert (format_utc_offset(SUMMER), format_utc_offset(WINTER)) == (summer, winter)
    for moment in (SUMMER, WINTER):
        assert parse_date_time(f"{moment.astimezone():%Y-%m-%dT%H:%M}") == moment


@pytest.mark.long
@pytest.mark.parametrize(
    ("zone", "displayed_text"),
    [
        ("UTC", "2026-07-01 22:00 UTC"),
        ("Asia/Kolkata", "2026-07-02 03:30 UTC+5:30"),
        ("America/St_Johns", "2026-07-01 19:30 UTC-2:30"),
    ],
)
def test_a_browser_shows_a_moment_in_the_zone_of_its_reader(
    server_in: pytest.MonkeyPatch, zone: str, displayed_text: str
) -> None:
    server_in.setenv("TZ", "UTC")
    time.tzset()
    moment = rendering._format_moment(datetime(2026, 7, 1, 22, tzinfo=UTC))
    with chromium() as browser:
        page = browser.new_context(timezone_id=zone).new_page()
        page.set_content(f"<p>{moment}</p>")
        page.add_script_tag(path=ROOT / "service/web/static/robomark.js")
        assert page.inner_text("p") == displayed_text
        assert (page.get_attribute("time", "title") or displayed_text) == "2026-07-01 22:00 UTC"
