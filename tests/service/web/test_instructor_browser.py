"""An instructor's tasks in Chromium, with a real worker: an assignment from the catalogue and a batch of twenty.

They include a replay, adjusted marks, publication, and the student's view of the batch.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import expect

from browsing import DESKTOP, PHONE, assert_in_order, chromium, follow
from builders import settings_in
from service.queue.embedded_services import EmbeddedServices
from service.store.engine import open_store
from service.web.app import make_app
from serving import served
from submissions.assignment.examples import locate_examples
from web import Web

pytestmark = pytest.mark.long

ASSIGNMENT = "echo-responder"
STUDENTS = [f"student{number:02}" for number in range(20)]


@contextmanager
def grading(folder: Path) -> Iterator[tuple[Web, str]]:
    """Run the web application with broker and worker; yield it and its address."""
    settings = settings_in(folder)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        web = Web(services.settings, store, make_app(services.settings, store))
        with served(web.app) as address:
            yield web, address


def a_class(folder: Path) -> Path:
    """Return twenty submissions: some lack parts of the reference, and one is invalid."""
    reference = locate_examples(ASSIGNMENT) / "reference"
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


def test_from_the_assignment_to_publication(tmp_path: Path) -> None:
    complaints: list[str] = []
    with grading(tmp_path / "home") as (web, address), chromium() as browser:
        grace = web.instructor()
        within = browser.new_context(**DESKTOP)
        page = within.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(f"{address}/sign-in/{web.link(grace)}")
        page.locator("main button").click()
        page.get_by_role("link", name="Assignments").click()
        follow(page.get_by_role("link", name="Choose from"))
        assert_in_order(page)
        # The list is filtered while typing.
        page.get_by_label("Search").press_sequentially("echo robot")
        expect(page.locator("#found h3")).to_have_count(1)
        assert_in_order(page)
        page.get_by_role("button", name="Add to course: Echo what the robot says").click()
        page.get_by_role("button", name="Open for students").click()
        expect(page.locator(".tag.good").first).to_have_text("open")
        assert_in_order(page)

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
        page.get_by_role("button", name="Check upload").click()
        expect(page.locator("main")).to_contain_text("20 submissions can be accepted. 1 submission is rejected.")
        assert_in_order(page)
        page.get_by_role("button", name="Grade 20 submissions").click()
        expect(page.locator("progress")).to_be_visible()
        assert_in_order(page)
        expect(page.locator("#progress .tag.good")).to_have_text("completed", timeout=180_000)
        expect(page.locator("tbody tr")).to_have_count(21)
        assert_in_order(page)

        page.get_by_role("link", name="Overview").click()
        expect(page.locator("main")).to_contain_text("Most common causes")
        assert_in_order(page)
        page.locator("table a", has_text="student00").first.click()
        page.wait_for_selector("section.replay[data-ready]")
        watch = page.locator("a.watch").first
        failed = (watch.text_content() or "").rpartition(" at ")[2].removesuffix(" s")
        watch.click()
        page.wait_for_function(f"() => Math.abs(document.querySelector('input.moment').value - {failed}) < 0.01")
        assert_in_order(page)
        page.get_by_role("link", name="Adjust marks and comment").click()
        expect(page.locator("main")).to_contain_text("student00 · Echo what the robot says · Attempt 1")
        lost = page.locator("article", has_text="The responder echoes each message")
        lost.get_by_text("Adjust marks").click()
        lost.get_by_label("Marks, 0 to 4").fill("3")
        lost.get_by_label("Reason").fill("It answers every time.")
        lost.get_by_role("button", name="Save marks").click()
        expect(lost).to_contain_text("3 / 4 adjusted by staff It answers every time.")
        assert_in_order(page)
        page.get_by_role("link", name="Report", exact=True).click()
        page.get_by_role("link", name="Batch", exact=True).click()
        page.get_by_role("link", name="Publish all").click()
        expect(page.locator("main")).to_contain_text("This releases 20 grades to their students.")
        assert_in_order(page)
        page.get_by_role("button", name="Publish all").click()
        expect(page.locator(".message")).to_contain_text("20 grades published.")
        expect(page.locator("td .tag.good")).to_have_count(20)
        batch = page.url

        page.get_by_role("link", name="People").click()
        page.get_by_role("link", name="student00").click()
        page.get_by_role("button", name="Create sign-in link").click()
        page.get_by_role("button", name="Copy").click()
        expect(page.get_by_role("button", name="Copied")).to_be_visible()
        assert_in_order(page)
        page.reload()
        student = browser.new_context(**PHONE).new_page()
        student.goto(page.locator("#secret").input_value())
        student.locator("main button").click()
        student.get_by_role("link", name="Attempt 1").click()
        expect(student.locator("main")).to_contain_text("It answers every time.")
        assert_in_order(student)

        phone = browser.new_context(**PHONE, color_scheme="dark", storage_state=within.storage_state())
        narrow = phone.new_page()
        course = f"{address}/courses/1"
        of_batch = [re.sub(r"\?.*", part, batch) for part in ("/overview", "/publish", "/similar")]
        for path in (
            batch,
            *of_batch,
            *(
                f"{course}/{each}"
                for each in ("batches", "people", "catalogue", "catalogue/image-parser", "assignments")
            ),
        ):
            narrow.goto(path)
            assert_in_order(narrow)

        scriptless = browser.new_context(**DESKTOP, java_script_enabled=False, storage_state=within.storage_state())
        plain = scriptless.new_page()
        plain.goto(f"{address}/courses/1/assignments")
        plain.get_by_label("Search").fill("lollipop noise")
        plain.get_by_role("button", name="Show").click()
        plain.get_by_role("button", name="Add to course").click()
        expect(plain.locator("h1")).to_have_text("Lollipop with noise")
        plain.goto(f"{address}/courses/1/batches")
        plain.locator("#assignment").select_option(ASSIGNMENT)
        plain.locator("#files").set_input_files(a_class(tmp_path))
        plain.get_by_role("button", name="Check upload").click()
        plain.get_by_role("button", name="Grade 20 submissions").click()
        expect(plain.locator("main")).to_contain_text("No new submissions.")
    assert complaints == []
