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
    executable = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if executable is None:
        pytest.skip("there is no Chromium here")
    # Chromium's own sandbox does not work for root; the pages are our own.
    flags = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=flags)
        yield browser
        browser.close()


@dataclass(frozen=True, slots=True)
class OpenPage:
    """A page, its network requests and its error messages."""

    page: Page
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


@contextmanager
def opened(browser: Browser, file: Path, after: str = "", **context: Any) -> Iterator[OpenPage]:
    """Open the page in a file, without a network, and wait until its replay is ready."""
    within = browser.new_context(**context)
    within.set_offline(True)
    opened_page = OpenPage(within.new_page())
    page = opened_page.page
    page.on(
        "request", lambda request: None if request.url.startswith("data:") else opened_page.requests.append(request.url)
    )
    page.on("pageerror", lambda error: opened_page.complaints.append(str(error)))
    page.on(
        "console",
        lambda console_message: (
            opened_page.complaints.append(console_message.text) if console_message.type == "error" else None
        ),
    )

    def dismiss(dialog: Dialog) -> None:
        opened_page.complaints.append("a dialog")
        dialog.dismiss()

    page.on("dialog", dismiss)
    page.goto(file.as_uri() + after)
    page.wait_for_selector("section.replay[data-ready]")
    yield opened_page
    within.close()


def follow(link: Locator) -> None:
    """Click a link and wait until its target has loaded; `click` itself returns while the old page is still active."""
    with link.page.expect_navigation():
        link.click()


def assert_in_order(page: Page) -> None:
    """Check that axe finds no fault, and that the page needs no horizontal scrolling."""
    violations = Axe().run(page).response["violations"]
    assert not violations, (
        page.url,
        [(each["id"], [node["html"][:200] for node in each["nodes"]]) for each in violations],
    )
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth"), page.url
