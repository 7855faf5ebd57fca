"""The replays of runs and checks in a browser, in JupyterLab 4 and Notebook 7.

Pictures of them are written to the folder ``ROBOMARK_PICTURES`` if that is set.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, ViewportSize, expect

from browsing import chromium
from jupyter_environment import FAULT, JupyterEnvironment, serving_jupyter, share_environment, write_task

pytestmark = pytest.mark.long

_RUN_SECONDS = 120
PICTURES = os.environ.get("ROBOMARK_PICTURES")
DESKTOP: ViewportSize = {"width": 1280, "height": 1600}


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> JupyterEnvironment:
    return share_environment(tmp_path_factory.getbasetemp())


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


@pytest.mark.parametrize(("module", "theme"), [("jupyterlab", "JupyterLab Light"), ("notebook", "JupyterLab Dark")])
def test_a_run_and_a_check_in_a_browser(
    environment: JupyterEnvironment, browser: Browser, tmp_path: Path, module: str, theme: str
) -> None:
    write_task(tmp_path)
    with serving_jupyter(environment, module, tmp_path, theme) as address:
        page = browser.new_page(viewport=DESKTOP)
        complaints: list[str] = []
        # Only modules of widgets are blobs: Jupyter has errors of its own.
        page.on("pageerror", lambda error: complaints.append(str(error.stack)) if "blob:" in str(error.stack) else None)
        page.goto(address)
        run_all_cells(page)

        expect(page.locator(".robomark[data-ready]")).to_have_count(2, timeout=90_000)
        run, check = page.locator(".robomark").all()
        assert_keys_move_the_replay_only(page, run)
        assert_links_move_the_replay_only(page, run)
        take_picture(page, f"{module}-run")
        assert_watch_opens_the_moment(check)
        take_picture(page, f"{module}-check")
        expect(page.get_by_text(FAULT).first).to_be_visible()
        assert complaints == []
        page.close()


def run_all_cells(page: Page) -> None:
    page.wait_for_selector(".jp-Notebook .jp-Cell", timeout=60_000)
    page.wait_for_selector(".jp-Notebook-ExecutionIndicator[data-status='idle']", timeout=60_000)
    # The page forgets what it was to run when it gets to know its kernel.
    first_prompt, end = page.locator(".jp-InputPrompt").first, time.monotonic() + _RUN_SECONDS
    while not re.fullmatch(r"\[\d+\]:", prompt := first_prompt.inner_text()):
        assert time.monotonic() < end, prompt
        if prompt == "[ ]:":
            page.get_by_role("menuitem", name="Run", exact=True).click()
            page.locator(".lm-Menu-item[data-command='runmenu:run-all']").click()
        page.wait_for_timeout(1000)


def take_picture(page: Page, name: str) -> None:
    if PICTURES:
        page.screenshot(path=str(Path(PICTURES) / f"{name}.png"))


def read_clock(widget: Locator) -> float:
    return float(widget.locator(".clock").inner_text().split()[0])


def assert_keys_move_the_replay_only(page: Page, widget: Locator) -> None:
    slider = widget.locator(".moment")
    slider.focus()
    page.keyboard.press("End")
    end = read_clock(widget)
    assert end > 1
    expect(widget.locator(".source [aria-current].wrong")).to_have_count(1)
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowDown")
    expect(slider).to_be_focused()
    assert read_clock(widget) == pytest.approx(end - 1.1, abs=0.06)
    expect(widget.locator(".source .wrong")).to_have_count(0)


def assert_links_move_the_replay_only(page: Page, widget: Locator) -> None:
    widget.locator(".moment").focus()
    page.keyboard.press("End")
    address, end = page.url, read_clock(widget)
    widget.locator(".happened a").last.click()
    assert page.url == address
    assert read_clock(widget) < end


def assert_watch_opens_the_moment(widget: Locator) -> None:
    button = widget.locator("button.watch").first
    button.click()
    assert f"Watch at {read_clock(widget):.1f} s" == button.inner_text()
