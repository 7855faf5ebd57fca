"""A student's way in Chromium on a phone, with a worker that grades: upload, wait, report, replay; and a tryout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from browsing import PHONE, chromium
from builders import settings_in
from paths import ROOT
from service.queue.embedded import EmbeddedServices
from service.store import open_assignments
from service.store.engine import open_store
from service.store.versions import freeze
from service.web.app import make_app
from serving import served
from submissions.assignment.reader import find_assignment
from web import Web

pytestmark = pytest.mark.long

ASSIGNMENT = "stop-on-the-red-circle"
PATIENCE = 120_000
EXAMPLES = ROOT / "submissions" / "catalogue" / ASSIGNMENT / "examples"
FIRST_BAND = (EXAMPLES / "first-band" / "robot.py").read_text()
REFERENCE = (EXAMPLES / "reference" / "robot.py").read_text()
FAILS = "import time\nprint('begun')\ntank_drive.on(20, 20)\ntime.sleep(2)\nprint(undefined)\n"
MOMENT = "() => [location.hash, document.querySelector('.moment').value]"


@dataclass(frozen=True, slots=True)
class Served:
    """A web application with a worker behind it, and where it is."""

    web: Web
    address: str


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    settings = settings_in(tmp_path_factory.mktemp("home"), concurrency=1)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        web = Web(services.settings, store, make_app(services.settings, store))
        web.instructor()
        with store.transaction() as session:
            open_assignments.prepare(session, 1, freeze(find_assignment(ASSIGNMENT)))
            open_assignments.open_for_students(session, 1, ASSIGNMENT)
        with served(web.app) as address:
            yield Served(web, address)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


def _page(browser: Browser, running: Served, student: str, **context: object) -> Page:
    """A phone that is signed in as a student, on the page of their work."""
    page = browser.new_context(**{**PHONE, **context}).new_page()
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.goto(f"{running.address}/sign-in/{running.web.link(running.web.student(student))}")
    page.locator("main button").click()
    page.wait_for_url("**/mine")
    return page


def _assert_in_order(page: Page) -> None:
    """Nothing has to be pushed sideways, and axe finds nothing."""
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    found = Axe().run(page).response["violations"]
    assert not found, [(each["id"], [node["html"][:200] for node in each["nodes"]]) for each in found]


def test_from_the_upload_to_the_second_that_failed(browser: Browser, running: Served) -> None:
    page = _page(browser, running, "ada")
    page.get_by_role("link", name="Ignore the bands").click()
    _assert_in_order(page)
    page.set_input_files("#files", {"name": "robot.py", "mimeType": "text/x-python", "buffer": FIRST_BAND.encode()})
    page.get_by_role("button", name="Submit", exact=True).click()
    # The page follows by itself until the report is there.
    page.wait_for_selector("section.replay[data-ready]", timeout=PATIENCE)
    _assert_in_order(page)
    expect(page.locator(".score")).to_contain_text("of 10 marks")
    watch = page.get_by_role("link", name="Watch it at").first
    second = (watch.text_content() or "").removeprefix("Watch it at ").removesuffix(" s")
    watch.click()
    moment, slider = page.evaluate(MOMENT)
    assert moment.startswith("#trial=1&t=")
    assert float(slider) == pytest.approx(float(second), abs=0.01)

    page.get_by_role("link", name="submit again").click()
    page.locator("summary").click()
    page.get_by_label("robot.py").fill(REFERENCE)
    page.get_by_role("button", name="Submit", exact=True).click()
    page.wait_for_selector("section.replay[data-ready]", timeout=PATIENCE)
    expect(page.locator(".score")).to_contain_text("10")
    expect(page.locator("svg.curve circle")).to_have_count(2)
    _assert_in_order(page)
    page.get_by_role("link", name="My work").first.click()
    _assert_in_order(page)
    expect(page.locator(".cards")).to_contain_text("Attempt 2: 10 of 10 marks")


def test_a_program_is_tried_without_a_mark(browser: Browser, running: Served) -> None:
    page = _page(browser, running, "bob")
    page.get_by_role("link", name="Ignore the bands").click()
    page.get_by_role("link", name="Try a program").click()
    page.get_by_label("robot.py").fill(FAILS)
    page.get_by_role("button", name="Try it").click()
    page.wait_for_selector("section.replay[data-ready]", timeout=PATIENCE)
    _assert_in_order(page)
    expect(page.locator("#tried")).to_contain_text("NameError: name 'undefined' is not defined")
    expect(page.locator("#tried pre").first).to_contain_text("begun")
    expect(page.get_by_label("robot.py")).to_have_value(FAILS)
    page.get_by_role("link", name="Watch it").first.click()
    assert page.evaluate(MOMENT) == ["#trial=1&t=2.000", "2"]
    page.goto(f"{running.address}/courses/1/mine")
    expect(page.locator(".cards")).to_contain_text("nothing submitted yet")


def test_all_of_it_works_without_javascript(browser: Browser, running: Served) -> None:
    page = _page(browser, running, "cid", java_script_enabled=False)
    page.get_by_role("link", name="Ignore the bands").click()
    page.set_input_files("#files", {"name": "robot.py", "mimeType": "text/x-python", "buffer": REFERENCE.encode()})
    page.get_by_role("button", name="Submit", exact=True).click()
    # The page is loaded anew every few seconds.
    expect(page.locator(".score")).to_contain_text("of 10 marks", timeout=PATIENCE)
    page.get_by_role("link", name="submit again").click()
    page.get_by_role("link", name="Try a program").click()
    page.get_by_label("robot.py").fill(FAILS)
    page.get_by_role("button", name="Try it").click()
    expect(page.locator("#tried")).to_contain_text("NameError", timeout=PATIENCE)
