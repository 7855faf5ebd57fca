"""The editor in Chromium, with a worker: by keyboard alone, on a phone and a desktop, in light and dark."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Locator, Page, expect

from browsing import DESKTOP, PHONE, assert_in_order, chromium, follow
from serving import Site, site_with_worker

pytestmark = pytest.mark.long

ASSIGNMENT = "stop-on-the-red-circle"
PATIENCE = 120_000
TYPED = ["import time", "if True:", "print('begun')", "time.sleep(1)", "print(undefined)"]
PROGRAM = "import time\nif True:\n    print('begun')\n    time.sleep(1)\n    print(undefined)"
#: The element with the focus, also in a shadow root.
FOCUSED = "(sought) => sought === document.activeElement || sought === document.activeElement.shadowRoot?.activeElement"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with site_with_worker(tmp_path_factory.mktemp("home"), ASSIGNMENT) as made:
        yield made


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


def _open(site: Site, browser: Browser, student: str, complaints: list[str], **context: object) -> Page:
    """Return the page of a student's work. Errors in its console, such as those of the policy, are complaints."""
    page = site.sign_in(browser, site.web.student(student), **context)
    page.set_default_timeout(PATIENCE)

    def note(message: ConsoleMessage) -> None:
        if message.type == "error":
            complaints.append(message.text)

    page.on("console", note)
    return page


def _tab_to(page: Page, target: Locator, key: str = "Tab") -> None:
    """Press Tab until the target has the focus."""
    for _ in range(60):
        page.keyboard.press(key)
        if target.evaluate(FOCUSED):
            return
    pytest.fail(f"{key} does not reach {target}")


def _follow_by_keyboard(page: Page, link: Locator) -> None:
    _tab_to(page, link)
    with page.expect_navigation():
        page.keyboard.press("Enter")


def _type(page: Page, lines: list[str]) -> None:
    for line in lines[:-1]:
        page.keyboard.type(line)
        page.keyboard.press("Enter")
    page.keyboard.type(lines[-1])


def _check_all_sizes(page: Page) -> None:
    """Run axe in light and dark, on a desktop and on a phone."""
    for size in (PHONE, DESKTOP):
        page.set_viewport_size(size["viewport"])
        for scheme in ("dark", "light"):
            page.emulate_media(color_scheme=scheme)
            assert_in_order(page)


def test_a_program_is_written_run_mended_and_submitted_by_keyboard(site: Site, browser: Browser) -> None:
    complaints: list[str] = []
    page = _open(site, browser, "ada", complaints, **DESKTOP)
    _follow_by_keyboard(page, page.get_by_role("link", name="Ignore the bands"))
    _follow_by_keyboard(page, page.get_by_role("link", name="Open editor"))
    editor = page.get_by_role("textbox", name="robot.py")
    _tab_to(page, editor)
    expect(editor).to_have_accessible_description(re.compile("To leave the editor with Tab, press Escape first."))
    page.keyboard.press("Control+a")
    _type(page, TYPED)
    expect(page.locator("#text1")).to_have_value(PROGRAM)

    # Tab indents, and leaves the editor after Escape.
    page.keyboard.press("Tab")
    expect(page.locator("#text1")).to_have_value(PROGRAM.replace("    print(undefined)", "        print(undefined)"))
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Escape")
    page.keyboard.press("Tab")
    assert not editor.evaluate(FOCUSED)
    _tab_to(page, page.get_by_role("button", name="Run", exact=True))
    page.keyboard.press("Enter")
    expect(page.locator("#run-status")).to_contain_text("line 5: NameError", timeout=PATIENCE)
    page.wait_for_selector("section.replay[data-ready]")
    assert page.get_by_role("button", name="Run", exact=True).evaluate(FOCUSED)
    expect(page.locator(".cm-message")).to_have_text("NameError: name 'undefined' is not defined")
    expect(page.locator("#result pre").first).to_contain_text("begun")
    _check_all_sizes(page)

    # The link to the error leads to its line.
    link = page.get_by_role("link", name="line 5")
    _tab_to(page, link)
    page.keyboard.press("Enter")
    assert editor.evaluate(FOCUSED)
    page.keyboard.press("Shift+End")
    page.keyboard.type("    tank_drive.off()")
    page.keyboard.press("Control+Enter")
    expect(page.locator("#run-status")).to_contain_text("completed without errors", timeout=PATIENCE)
    assert editor.evaluate(FOCUSED)
    expect(page.locator(".cm-message")).to_have_count(0)
    expect(page.locator("section.replay")).to_have_count(1)

    page.keyboard.press("Escape")
    _tab_to(page, page.get_by_role("button", name="Submit", exact=True))
    with page.expect_navigation():
        page.keyboard.press("Enter")
    page.wait_for_url("**/submissions/*")
    expect(page.locator("main")).to_contain_text("tank_drive.off()", timeout=PATIENCE)
    assert not complaints


def test_another_text_is_loaded_and_undone(site: Site, browser: Browser) -> None:
    complaints: list[str] = []
    page = _open(site, browser, "bob", complaints, **PHONE)
    page.goto(f"{site.address}/courses/1/mine/{ASSIGNMENT}/try")
    editor = page.get_by_role("textbox", name="robot.py")
    starter = page.locator("#text1").input_value()
    assert starter
    editor.click()
    page.keyboard.press("Control+a")
    page.keyboard.type("print(1)")
    page.keyboard.press("Control+Enter")
    page.wait_for_selector("section.replay[data-ready]")
    page.reload()
    expect(page.locator("#text1")).to_have_value("print(1)")
    page.get_by_role("link", name="Starter program").click()
    expect(page.locator("#text1")).to_have_value(starter)
    expect(page.locator("#run-status")).to_have_text("The program is in the editor. Undo restores your text.")
    editor.click()
    page.keyboard.press("Control+z")
    expect(page.locator("#text1")).to_have_value("print(1)")
    assert not complaints


def test_a_failing_server_is_named_and_the_text_stays(site: Site, browser: Browser) -> None:
    page = _open(site, browser, "cid", [], **DESKTOP)
    page.goto(f"{site.address}/courses/1/playground")
    page.get_by_role("textbox", name="robot.py").click()
    page.keyboard.type("# mine ")
    page.context.set_offline(True)
    page.keyboard.press("Control+Enter")
    expect(page.locator("#run-failed")).to_be_visible()
    page.context.set_offline(False)
    page.keyboard.press("Control+Enter")
    page.wait_for_selector("section.replay[data-ready]")
    expect(page.locator("#run-failed")).to_be_hidden()
    assert page.locator("#text1").input_value().count("# mine ") == 1


def test_the_playground_runs_on_the_chosen_floor(site: Site, browser: Browser) -> None:
    complaints: list[str] = []
    page = _open(site, browser, "dan", complaints, **PHONE)
    follow(page.get_by_role("link", name="Playground"))
    page.wait_for_load_state("networkidle")
    page.get_by_label("Floor", exact=True).select_option("Loop")
    expect(page.get_by_label("Heading (degrees)")).to_have_value("90")
    page.get_by_label("x (mm)").fill("700")
    page.get_by_label("x (mm)").press("Tab")
    expect(page.locator("figure.start")).to_contain_text("Start on Loop: x 700 mm")
    page.get_by_label("y (mm)").fill("7000")
    page.get_by_role("button", name="Run", exact=True).click()
    expect(page.locator("#result")).to_be_empty()  # the browser explains the range
    page.get_by_label("y (mm)").fill("300")
    page.get_by_role("button", name="Run", exact=True).click()
    page.wait_for_selector("section.replay[data-ready]")
    expect(page.locator(".readings").first).to_contain_text("x 700.0, y 300.0 mm, heading 90.0°")
    _check_all_sizes(page)
    page.reload()
    expect(page.get_by_label("Floor", exact=True)).to_have_value("Loop")
    page.wait_for_selector("section.replay[data-ready]")
    assert not complaints
