"""Chromium without a screen, which opens pages from files and tells what went wrong in them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Dialog, Locator, Page, sync_playwright

_NAMES = ("chromium", "chromium-browser", "google-chrome")
PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2, "has_touch": True}
DESKTOP: dict[str, Any] = {"viewport": {"width": 1280, "height": 900}}


@contextmanager
def chromium() -> Iterator[Browser]:
    """The machine's browser; a test that needs it is skipped where there is none."""
    found = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("there is no Chromium here")
    # Root has no sandbox of Chromium's; the pages are our own.
    flags = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=flags)
        yield browser
        browser.close()


@dataclass(frozen=True, slots=True)
class OpenPage:
    """A page, what it asked of the network, and what it complained of."""

    page: Page
    asked: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


@contextmanager
def opened(browser: Browser, file: Path, after: str = "", **context: Any) -> Iterator[OpenPage]:
    """The page in a file, without a network, when its replay is ready."""
    within = browser.new_context(**context)
    within.set_offline(True)
    found = OpenPage(within.new_page())
    page = found.page
    page.on("request", lambda request: None if request.url.startswith("data:") else found.asked.append(request.url))
    page.on("pageerror", lambda error: found.complaints.append(str(error)))
    page.on("console", lambda said: found.complaints.append(said.text) if said.type == "error" else None)

    def dismiss(dialog: Dialog) -> None:
        found.complaints.append("a dialog")
        dialog.dismiss()

    page.on("dialog", dismiss)
    page.goto(file.as_uri() + after)
    page.wait_for_selector("section.replay[data-ready]")
    yield found
    within.close()


def follow(link: Locator) -> None:
    """Click, and wait until the page that it leads to is there: `click` itself returns while the old one still goes."""
    with link.page.expect_navigation():
        link.click()


def assert_in_order(page: Page) -> None:
    """No fault that axe finds, and nothing has to be pushed sideways."""
    found = Axe().run(page).response["violations"]
    assert not found, (page.url, [(each["id"], [node["html"][:200] for node in each["nodes"]]) for each in found])
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth"), page.url
