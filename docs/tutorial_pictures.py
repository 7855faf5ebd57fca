"""Photographs of the pages in the tutorial. Its steps are carried out in Chromium, on a new installation."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

_TUTORIAL = Path(__file__).with_name("tutorial.md")
_ASSIGNMENT = "shape-recognition"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_WIDTH = 1080
_COLOURS = 255  # enough for pages, and a third of the size
_WAIT = 120  # seconds


def find_browser() -> str:
    """Return the path of Chromium. Raises SystemExit if there is none."""
    found = next((path for name in _BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        raise SystemExit("pictures of pages need Chromium; expected " + " or ".join(_BROWSERS))
    return found


def photograph_tutorial(folder: Path) -> None:
    """Write the pictures ``tutorial-*.png`` and ``student-editor.png`` into a folder. Takes a minute."""
    browser_path = find_browser()
    # Chromium's own sandbox does not work for root; the pages are our own.
    flags = ["--no-sandbox"] if os.geteuid() == 0 else []
    with TemporaryDirectory() as work, _installation(Path(work)) as link, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=flags)
        _make_class(Path(work))
        _photograph_instructor(browser, link, Path(work), folder)
        _photograph_student(browser, link, Path(work), folder)
        browser.close()


def _environment(work: Path) -> dict[str, str]:
    commands = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    return os.environ | {"ROBOMARK_HOME": str(work / "home"), "LOGNAME": "grace", "PATH": commands, "LANG": "C.UTF-8"}


@contextmanager
def _installation(work: Path) -> Iterator[str]:
    """Run ``robomark up`` in a new home. Yield the first sign-in link."""
    with (work / "up.log").open("w") as log:
        command = ["robomark", "up", "--port", "0"]
        running = subprocess.Popen(command, env=_environment(work), stdout=log, stderr=log)
        try:
            file, end = work / "home" / "sign-in-link", time.monotonic() + _WAIT
            while not file.exists() and running.poll() is None and time.monotonic() < end:
                time.sleep(0.1)
            yield file.read_text().strip()
        finally:
            running.terminate()
            running.wait()


def _make_class(work: Path) -> None:
    """Run the commands of the tutorial that create the class."""
    (block,) = (
        found for found in re.findall(r"```console\n(.*?)```", _TUTORIAL.read_text(), re.DOTALL) if "class.zip" in found
    )
    script = re.sub(r"(?m)^\$ ", "", block)
    subprocess.run(["bash", "-e"], input=script, text=True, cwd=work, env=_environment(work), check=True)


def _photograph_instructor(browser: Browser, link: str, work: Path, folder: Path) -> None:
    page = _sign_in(browser, link)
    course = re.sub(r"/sign-in/.*", "/courses/1", link)
    page.goto(f"{course}/catalogue?q=shape+recognise")
    page.locator(f"button[value='{_ASSIGNMENT}']").click()
    page.locator("form[action$='/open'] button").click()
    _photograph(page, folder / "tutorial-assignment.png", 830)

    page.goto(f"{course}/batches")
    page.locator("#assignment").select_option(_ASSIGNMENT)
    page.locator("#files").set_input_files(work / "class.zip")
    page.locator("form[action$='/uploads'] > button").click()
    _photograph(page, folder / "tutorial-preview.png", 780)
    page.locator("form[action$='/confirm'] button").click()
    page.locator("a[href$='/publish']").wait_for()
    batch = page.url.partition("?")[0]
    page.goto(f"{batch}/overview")
    _photograph(page, folder / "tutorial-overview.png", 1000)
    page.goto(batch)
    page.get_by_role("link", name="ben", exact=True).click()
    page.wait_for_selector("section.replay[data-ready]")
    _photograph(page, folder / "tutorial-report.png", 1100)
    page.goto(batch)
    _photograph(page, folder / "tutorial-batch.png", 680)
    page.goto(f"{batch}/publish")
    page.locator("form[action$='/publish'] button").click()


def _photograph_student(browser: Browser, link: str, work: Path, folder: Path) -> None:
    made = subprocess.check_output(["robomark", "user", "link", "ben"], env=_environment(work), text=True)
    address = link.partition("/sign-in/")[0]
    page = _sign_in(browser, address + made.split()[0])
    page.goto(f"{address}/courses/1/mine/{_ASSIGNMENT}/try")
    page.get_by_role("textbox", name="robot.py").click()
    page.keyboard.press("Control+End")
    page.keyboard.type("print(messages)\n")
    page.get_by_role("button", name="Run", exact=True).click()
    page.wait_for_selector("section.replay[data-ready]")
    page.locator(".cm-message").wait_for()
    _photograph(page, folder / "student-editor.png", 900)
    page.goto(f"{address}/courses/1/mine/{_ASSIGNMENT}")
    page.locator("input[type=file]").set_input_files([work / "class/ada/robot.py", work / "class/ada/responder.py"])
    page.locator("main form.stack button:not([formaction])").first.click()
    page.wait_for_selector("section.replay[data-ready]")
    _photograph(page, folder / "tutorial-student.png", 900)


def _sign_in(browser: Browser, link: str) -> Page:
    context = browser.new_context(viewport={"width": _WIDTH, "height": 800}, locale="en-GB", timezone_id="UTC")
    context.set_default_timeout(1000 * _WAIT)
    page = context.new_page()
    page.goto(link)
    page.locator("main button").click()
    page.wait_for_load_state()
    return page


def _photograph(page: Page, picture: Path, height: int) -> None:
    """Write the upper part of a page, with few colours."""
    page.wait_for_load_state("networkidle")
    page.screenshot(path=picture, full_page=True)
    with Image.open(picture) as whole:
        upper = whole.convert("RGB").crop((0, 0, _WIDTH, min(height, whole.height)))
    upper.quantize(_COLOURS, dither=Image.Dither.NONE).save(picture, optimize=True)
