"""A student's tasks in Chromium on a phone, with a worker: upload, report, replay, appeal; and a test run."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from browsing import DESKTOP, PHONE, assert_in_order, chromium, follow
from paths import ROOT
from serving import Site, site_with_worker

pytestmark = pytest.mark.long

ASSIGNMENT = "stop-on-the-red-circle"
PATIENCE = 120_000
EXAMPLES = ROOT / "submissions" / "catalogue" / ASSIGNMENT / "examples"
FIRST_BAND = (EXAMPLES / "first-band" / "robot.py").read_text()
REFERENCE = (EXAMPLES / "reference" / "robot.py").read_text()
FAILS = "import time\nprint('begun')\ntank_drive.on(20, 20)\ntime.sleep(2)\nprint(undefined)\n"
SOUGHT = "() => Number(document.querySelector('.moment').value) > 0"
MOMENT = "() => [location.hash, document.querySelector('.moment').value]"


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with site_with_worker(tmp_path_factory.mktemp("home"), ASSIGNMENT) as site:
        yield site


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


def _page(browser: Browser, running: Site, student: str, **context: object) -> Page:
    """Return a phone signed in as a student, on the page of the student's work."""
    return running.sign_in(browser, running.web.student(student), **{**PHONE, **context})


def test_from_the_upload_to_the_second_that_failed(browser: Browser, running: Site) -> None:
    page = _page(browser, running, "ada")
    follow(page.get_by_role("link", name="Ignore the bands"))
    assert_in_order(page)
    page.set_input_files("#files", {"name": "robot.py", "mimeType": "text/x-python", "buffer": FIRST_BAND.encode()})
    page.get_by_role("button", name="Submit", exact=True).click()
    # The page updates itself until the report is available.
    page.wait_for_selector("section.replay[data-ready]", timeout=PATIENCE)
    assert_in_order(page)
    expect(page.locator(".score")).to_contain_text("of 10 marks")
    watch = page.get_by_role("link", name="Watch at").first
    second = (watch.text_content() or "").removeprefix("Watch at ").removesuffix(" s")
    watch.click()
    page.wait_for_function(SOUGHT)
    moment, slider = page.evaluate(MOMENT)
    assert moment.startswith("#trial=1&t=")
    assert float(slider) == pytest.approx(float(second), abs=0.01)

    page.get_by_role("link", name="Submit again").click()
    page.locator("summary").click()
    page.get_by_label("robot.py").fill(REFERENCE)
    page.get_by_role("button", name="Submit", exact=True).click()
    page.wait_for_selector("section.replay[data-ready]", timeout=PATIENCE)
    expect(page.locator(".score")).to_contain_text("10")
    expect(page.locator("svg.curve circle")).to_have_count(2)
    assert_in_order(page)
    follow(page.get_by_role("link", name="My work").first)
    assert_in_order(page)
    expect(page.locator(".cards")).to_contain_text("Attempt 2: 10 of 10 marks")
    page.go_back()

    page.get_by_role("link", name="Appeal this grade").click()
    page.get_by_label("Your appeal").fill("Does the other circle count, too?")
    page.get_by_role("button", name="Appeal this grade").click()
    expect(page.locator("main")).to_contain_text("not answered yet")
    assert_in_order(page)
    grace = browser.new_context(**DESKTOP).new_page()
    grace.goto(f"{running.address}/sign-in/{running.web.link(running.web.instructor())}")
    grace.locator("main button").click()
    follow(grace.get_by_role("link", name="Appeals 1"))
    assert_in_order(grace)
    grace.get_by_label("Answer").fill("No, the red one alone.")
    grace.get_by_role("button", name="Send answer").click()
    expect(grace.locator("main")).to_contain_text("No open appeals.")
    expect(grace.get_by_role("link", name="Appeals")).to_have_text("Appeals")
    page.reload()
    expect(page.locator("main")).to_contain_text("No, the red one alone.")
    assert_in_order(page)


def test_a_program_is_tried_without_a_mark(browser: Browser, running: Site) -> None:
    page = _page(browser, running, "bob")
    follow(page.get_by_role("link", name="Ignore the bands"))
    page.locator("summary").click()
    page.get_by_label("robot.py").fill(FAILS)
    page.get_by_role("button", name="Run without submitting").click()
    page.wait_for_selector("section.replay[data-ready]", timeout=PATIENCE)
    assert_in_order(page)
    expect(page.locator("#result")).to_contain_text("NameError: name 'undefined' is not defined")
    expect(page.locator("#result pre").first).to_contain_text("begun")
    expect(page.locator("#text1")).to_have_value(FAILS)
    page.get_by_role("link", name="Watch the replay").first.click()
    page.wait_for_function(SOUGHT)
    assert page.evaluate(MOMENT) == ["#trial=1&t=2.000", "2"]
    page.goto(f"{running.address}/courses/1/mine")
    expect(page.locator(".cards")).to_contain_text("No submissions yet.")


def test_all_of_it_works_without_javascript(browser: Browser, running: Site) -> None:
    page = _page(browser, running, "cid", java_script_enabled=False)
    follow(page.get_by_role("link", name="Ignore the bands"))
    page.set_input_files("#files", {"name": "robot.py", "mimeType": "text/x-python", "buffer": REFERENCE.encode()})
    page.get_by_role("button", name="Submit", exact=True).click()
    # The page reloads every few seconds.
    expect(page.locator(".score")).to_contain_text("of 10 marks", timeout=PATIENCE)
    page.get_by_role("link", name="Submit again").click()
    page.locator("summary").click()
    page.get_by_label("robot.py").fill(FAILS)
    page.get_by_role("button", name="Run without submitting").click()
    expect(page.locator("#result")).to_contain_text("NameError", timeout=PATIENCE)
