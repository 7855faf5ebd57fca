"""Headless Chromium that opens pages from files and reports their errors."""

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
    """Yield the machine's browser. Tests that need it are skipped if there is none."""
    found = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("there is no Chromium here")
    # Chromium's own sandbox does not work for root; the pages are our own.
    flags = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=flags)
        yield browser
        browser.close()


@dataclass(frozen=True, slots=True)
class OpenPage:
    """A page, its network requests and its error messages."""

    page: Page
    asked: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


@contextmanager
def opened(browser: Browser, file: Path, after: str = "", **context: Any) -> Iterator[OpenPage]:
    """Open the page in a file, without a network, and wait until its replay is ready."""
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
    """Click a link and wait until its target has loaded; `click` itself returns while the old page is still active."""
    with link.page.expect_navigation():
        link.click()


def assert_in_order(page: Page) -> None:
    """Check that axe finds no fault, and that the page needs no horizontal scrolling."""
    found = Axe().run(page).response["violations"]
    assert not found, (page.url, [(each["id"], [node["html"][:200] for node in each["nodes"]]) for each in found])
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth"), page.url
