"""The report in Chromium: the steps to the details, axe's findings with all of them open, and the type size."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

import report_builders as build
from browsing import DESKTOP, PHONE, chromium, opened
from service.reports.html import render_report_page
from service.reports.plots.grade_plots import draw_all_plots
from service.reports.plots.plot import DPI
from service.reports.view import build_student_view

pytestmark = pytest.mark.long

#: Type size in points: no text in a plot is smaller.
_SMALLEST = 8
OPEN_ALL = "document.querySelectorAll('details').forEach((each) => { each.open = true; })"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


def written(name: str, folder: Path) -> Path:
    grade = getattr(build, f"{name}_grade")()
    file = folder / f"{name}.html"
    file.write_text(render_report_page(build_student_view(grade), draw_all_plots(grade), build.faulty_submission()))
    return file


@pytest.mark.parametrize("name", ["shape", "faulty", "line_follower", "astray"])
def test_a_phone_shows_the_cause_at_once_and_the_details_after_three_screens(
    browser: Browser, tmp_path: Path, name: str
) -> None:
    file = written(name, tmp_path)
    with opened(browser, file, **PHONE) as opened_page:
        top = "(name) => document.querySelector(name).getBoundingClientRect().bottom"
        assert opened_page.page.evaluate(top, ".verdict") < 844
        assert opened_page.page.evaluate("document.querySelector('.details').getBoundingClientRect().top") <= 3 * 844
        assert opened_page.page.evaluate("document.documentElement.scrollWidth") == 390
        assert not opened_page.complaints
        assert opened_page.requests == [file.as_uri()]


@pytest.mark.parametrize("name", ["shape", "line_follower"])
def test_type_in_pictures_is_at_least_eleven_pixels_high_on_a_phone(
    browser: Browser, tmp_path: Path, name: str
) -> None:
    with opened(browser, written(name, tmp_path), **PHONE) as opened_page:
        opened_page.page.evaluate(OPEN_ALL)
        scales = opened_page.page.evaluate("[...document.images].map((each) => each.clientWidth / each.naturalWidth)")
        assert scales
        assert all(share * DPI / 72 * _SMALLEST >= 11 for share in scales)


@pytest.mark.parametrize("context", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["shape", "faulty"])
def test_axe_finds_nothing_when_all_is_open(
    browser: Browser, tmp_path: Path, name: str, context: dict[str, Any], scheme: str
) -> None:
    axe = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    with opened(browser, written(name, tmp_path), color_scheme=scheme, **context) as opened_page:
        opened_page.page.evaluate(OPEN_ALL)
        opened_page.page.evaluate(axe)
        wrong = opened_page.page.evaluate(
            "async () => (await axe.run()).violations.flatMap((each) => each.nodes.map((node) => [each.id, node.html]))"
        )
        assert wrong == []


def test_closed_details_are_printed_open_and_without_a_marker(browser: Browser, tmp_path: Path) -> None:
    with opened(browser, written("faulty", tmp_path), **DESKTOP) as opened_page:
        opened_page.page.emulate_media(media="print")
        closed = "document.querySelector('.details details:not([open])')"
        assert opened_page.page.evaluate(f"getComputedStyle({closed}.querySelector('summary')).listStyleType") == "none"
        heights = f"[{closed}.offsetHeight, {closed}.querySelector('summary').offsetHeight]"
        details_height, summary_height = opened_page.page.evaluate(heights)
        assert details_height > 1.5 * summary_height
