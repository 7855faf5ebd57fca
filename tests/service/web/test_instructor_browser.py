"""An instructor's way in Chromium, with a real worker: an assignment, a batch of twenty, a replay, publishing."""

from __future__ import annotations

import re
import socket
import threading
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import uvicorn
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from browsing import DESKTOP, PHONE, chromium
from builders import settings_in
from service.queue.embedded import EmbeddedServices
from service.store.engine import open_store
from service.web.app import make_app
from submissions.assignment.examples import examples
from web import Web

pytestmark = pytest.mark.long

ASSIGNMENT = "echo-responder"
STUDENTS = [f"student{number:02}" for number in range(20)]


@contextmanager
def served(folder: Path) -> Iterator[tuple[Web, str]]:
    """The web with broker and worker, and where it answers."""
    settings = settings_in(folder)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        listening = socket.create_server(("127.0.0.1", 0))
        web = Web(services.settings, store, make_app(services.settings, store))
        server = uvicorn.Server(uvicorn.Config(web.app, log_config=None, lifespan="off"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield web, f"http://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()


def a_class(folder: Path) -> Path:
    """Twenty submissions, of which a few drop what the reference has, and one that is none."""
    reference = examples(ASSIGNMENT) / "reference"
    path = folder / "week one.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for place, student in enumerate(STUDENTS):
            for file in reference.glob("*.py"):
                text = file.read_text() + f"\n# {student}\n"
                if place % 5 == 0 and file.name == "responder.py":
                    text = "def responder(msg):\n    return 'no'\n"
                archive.writestr(f"{student}/{file.name}", text)
        archive.writestr("nobody/notes.txt", "nothing")
    return path


def is_clean(page: Page) -> None:
    """No fault that axe finds, and nothing to scroll sideways."""
    found = Axe().run(page).response["violations"]
    assert [(each["id"], each["nodes"][0]["html"]) for each in found] == [], page.url
    assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth"), page.url


def test_from_the_assignment_to_publication(tmp_path: Path) -> None:
    complaints: list[str] = []
    with served(tmp_path / "home") as (web, address), chromium() as browser:
        grace = web.instructor()
        within = browser.new_context(**DESKTOP)
        page = within.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(f"{address}/sign-in/{web.link(grace)}")
        page.locator("main button").click()
        page.get_by_role("link", name="Assignments").click()
        page.locator("#assignment").select_option(ASSIGNMENT)
        page.get_by_role("button", name="Prepare it", exact=True).click()
        page.get_by_role("button", name="Open for students").click()
        expect(page.locator(".tag.good").first).to_have_text("open")
        is_clean(page)

        page.get_by_role("link", name="Batches").click()
        page.locator("#assignment").select_option(ASSIGNMENT)
        data = page.evaluate_handle(
            """(bytes) => {
                const data = new DataTransfer();
                data.items.add(new File([new Uint8Array(bytes)], "week one.zip", {type: "application/zip"}));
                return data;
            }""",
            list(a_class(tmp_path).read_bytes()),
        )
        page.dispatch_event(".drop", "drop", {"dataTransfer": data})
        page.get_by_role("button", name="Look what is in it").click()
        expect(page.locator("main")).to_contain_text("20 submissions can be taken in. 1 is refused.")
        is_clean(page)
        page.get_by_role("button", name="Grade 20 submissions").click()
        expect(page.locator("progress")).to_be_visible()
        is_clean(page)
        expect(page.locator("#progress .tag.good")).to_have_text("ready", timeout=180_000)
        expect(page.locator("tbody tr")).to_have_count(21)
        is_clean(page)

        page.get_by_role("link", name="Overview").click()
        expect(page.locator("main")).to_contain_text("Commonest causes")
        is_clean(page)
        page.locator("table a", has_text="student00").first.click()
        page.wait_for_selector("section.replay[data-ready]")
        page.locator("input.moment").first.evaluate(
            "slider => { slider.value = '2'; slider.dispatchEvent(new Event('input')); }"
        )
        is_clean(page)
        page.get_by_role("link", name="Batch", exact=True).click()
        page.get_by_role("button", name="Publish all").click()
        expect(page.locator(".told")).to_contain_text("20 grades are published now")
        expect(page.locator("td .tag.good")).to_have_count(20)
        batch = page.url

        phone = browser.new_context(**PHONE, color_scheme="dark", storage_state=within.storage_state())
        narrow = phone.new_page()
        course = f"{address}/courses/1"
        for path in (batch, re.sub(r"\?.*", "/overview", batch), f"{course}/batches", f"{course}/people"):
            narrow.goto(path)
            is_clean(narrow)

        scriptless = browser.new_context(**DESKTOP, java_script_enabled=False, storage_state=within.storage_state())
        plain = scriptless.new_page()
        plain.goto(f"{address}/courses/1/batches")
        plain.locator("#assignment").select_option(ASSIGNMENT)
        plain.locator("#files").set_input_files(a_class(tmp_path))
        plain.get_by_role("button", name="Look what is in it").click()
        plain.get_by_role("button", name="Grade 20 submissions").click()
        expect(plain.locator("main")).to_contain_text("Nothing of it is new")
    assert complaints == []
