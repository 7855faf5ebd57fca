"""A course's assignments on the web: selected, uploaded, opened, closed, removed."""

from __future__ import annotations

import re

import pytest
from httpx2 import Response
from sqlalchemy import select
from starlette.testclient import TestClient

import report_builders
from service.store import audit
from service.store.courses import open_assignments, policies
from service.store.states import Role
from service.store.tables.people import Enrolment
from service.store.tables.submissions import SubmissionRow
from submissions.assignment.folder import list_catalogue_ids, locate_assignment_folder
from submissions.assignment.reader import find_in_catalogue
from web import Web, grade_all, submit, words
from zips import zipped

HOME = "/courses/1"
ECHO = {"robot.py": "print('hello')\n", "responder.py": "def responder(msg):\n    return msg\n"}


def test_an_assignment_is_prepared_opened_and_closed(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/assignments"
    assert submit(grace, path, {"assignment": "echo-responder"}).headers["location"] == f"{path}/echo-responder"
    for action, is_open in (("open", True), ("close", False), ("open", True)):
        submit(grace, f"{path}/echo-responder/{action}")
        with web.store.reading() as session:
            assert open_assignments.load_course_assignment(session, 1, "echo-responder").open is is_open
    policy = {"assignment": "echo-responder", "due": "2026-11-30T17:00", "late_days": "2", "attempts": "3"}
    submit(grace, f"{HOME}/policy", policy)
    visible_text = grace.get(f"{path}/echo-responder").text
    assert 'value="2026-11-30T17:00"' in visible_text
    with web.store.reading() as session:
        allowed = policies.load_policies(session, 1)["echo-responder"]
        done = [entry.action for entry in audit.load_entries(session, "course", "1")]
    assert (allowed.late_days, allowed.attempts) == (2, 3)
    submit(grace, f"{HOME}/policy", policy | {"due": "2020-11-30T17:00"})
    page_text = words(grace.get(f"{path}/echo-responder?done=policy").text)
    assert "Changes saved." in page_text
    assert "Late submissions are no longer accepted" in page_text
    submit(grace, f"{path}/echo-responder/no-policy")
    assert "This assignment uses the default policy" in words(grace.get(f"{path}/echo-responder").text)
    assert done == ["prepare", "open", "close", "open", "policy"]
    assert submit(grace, f"{HOME}/policy", {"due": "soon"}).status_code == 422
    assert submit(grace, path, {"assignment": "/etc"}).status_code == 422


def test_an_assignment_that_nobody_was_shown_is_taken_out(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/assignments"
    one = f"{path}/echo-responder"
    submit(grace, path, {"assignment": "echo-responder"})
    submit(grace, f"{HOME}/policy", {"assignment": "echo-responder", "due": "2026-11-30T17:00"})
    submit(grace, f"{one}/names", {"hidden": "true"})
    assert "Remove from course" not in grace.get(one).text
    assert "removing it would show hidden names" in words(submit(grace, f"{one}/remove").text)
    submit(grace, f"{one}/names", {"hidden": "false"})
    assert "Remove from course" in grace.get(one).text
    assert submit(grace, f"{one}/remove").headers["location"] == path
    assert "No assignments yet" in grace.get(path).text
    assert submit(grace, f"{one}/remove").status_code == 422
    with web.store.reading() as session:
        assert policies.load_policies(session, 1) == {}
    submit(grace, path, {"assignment": "echo-responder"})
    submit(grace, f"{one}/open")
    submit(grace, f"{one}/close")
    assert "Remove from course" not in grace.get(one).text
    refused = submit(grace, f"{one}/remove")
    assert (refused.status_code, "close it instead" in words(refused.text)) == (422, True)


def test_an_own_assignment_is_checked_prepared_and_previewed(web: Web, grace: TestClient) -> None:
    folder = locate_assignment_folder("echo-responder")
    files = {
        f"mine/{path.relative_to(folder)}": path.read_text(encoding="utf-8")
        for path in folder.rglob("*")
        if path.is_file() and path.suffix in (".toml", ".py")
    }
    own = {"file": ("mine.zip", zipped(files), "application/zip")}
    answer = submit(grace, f"{HOME}/assignments/uploads", files=own)
    assert answer.status_code == 303, words(answer.text)
    grade_all(web, report_builders.faulty_grade())
    page_text = grace.get(answer.headers["location"]).text
    preview = re.search(rf'href="({HOME}/grades/\w+)"', page_text)
    assert preview
    assert grace.get(preview[1]).status_code == 200
    with web.store.reading() as session:
        role = select(Enrolment.role).join(SubmissionRow, SubmissionRow.enrolment_id == Enrolment.id)
        assert session.scalars(role).all() == [Role.INSTRUCTOR]
    assert submit(grace, f"{answer.headers['location']}/preview").status_code == 303
    german = grace.get(answer.headers["location"], headers={"accept-language": "de"}).text
    assert "</a>: in der Warteschlange</li>" in german
    files["mine/assignment.toml"] += '\n[[criterion]]\ntitle = "No check"\nmarks = 1\n'
    own = {"file": ("mine.zip", zipped(files), "application/zip")}
    answer = submit(grace, f"{HOME}/assignments/uploads", files=own)
    assert answer.status_code == 422
    assert "mine/assignment.toml:" in words(answer.text)
    assert grace.get(f"{HOME}/assignments/uploads").headers["location"] == f"{HOME}/assignments"
    answer = submit(grace, f"{HOME}/assignments/uploads", files={"file": ("mine.zip", zipped({"a/b.py": ""}))})
    assert "mine.zip: has no assignment.toml" in words(answer.text)
    example = grace.get(f"{HOME}/assignments/uploads/my-assignment.zip").content
    assert submit(grace, f"{HOME}/assignments/uploads", files={"file": ("my.zip", example)}).status_code == 303


def test_what_students_have_been_shown_is_replaced_by_an_upload_where_that_is_said(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/assignments"
    submit(grace, path, {"assignment": "echo-responder"})
    text = (locate_assignment_folder("echo-responder") / "assignment.toml").read_text(encoding="utf-8")

    def upload(title: str, **fields: str) -> Response:
        changed = re.sub("^title = .*", f'title = "{title}"', text, count=1, flags=re.MULTILINE)
        files = {"file": ("echo.zip", zipped({"echo-responder/assignment.toml": changed}), "application/zip")}
        return submit(grace, f"{path}/uploads", fields, files=files)

    assert 'name="replace"' not in grace.get(path).text
    assert upload("Nobody saw the other").status_code == 303
    submit(grace, f"{path}/echo-responder/open")
    refused = upload("Another")
    assert refused.status_code == 422
    assert "students have already seen another assignment with this ID, 'Nobody saw the other'" in words(refused.text)
    assert 'name="replace"' in refused.text
    assert upload("Nobody saw the other").status_code == 303
    assert "Nobody saw the other" in grace.get(path).text
    assert upload("Another", replace="true").status_code == 303
    assert "Another" in grace.get(path).text


@pytest.mark.long
def test_the_catalogue_is_looked_through_by_words_and_topic(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/catalogue"

    def search(query: str) -> list[str]:
        return re.findall(r'name="assignment" value="([^"]+)"', grace.get(f"{path}?{query}").text)

    assert sorted(search("")) == sorted(list_catalogue_ids())
    assert search("q=LOLLIPOP+noise") == ["lollipop-with-noise"]
    assert search("q=sensor&topic=05") == [each for each in search("topic=05") if each in search("q=sensor")]
    assert "relay-a-message" in search("topic=none")
    assert search("q=nothing+is+like+this") == []
    assert "<script" not in words(grace.get(f"{path}?q=%3Cscript%3E&topic=%22").text)
    submit(grace, f"{HOME}/assignments", {"assignment": "lollipop"})
    assert "lollipop" not in search("q=lollipop")
    assert f'href="{HOME}/assignments/lollipop"' in grace.get(f"{path}?q=lollipop").text


def test_an_assignment_of_the_catalogue_is_read_before_it_is_taken(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/catalogue/echo-responder"
    assert f'href="{path}"' in grace.get(f"{HOME}/catalogue").text
    asks = find_in_catalogue("echo-responder")
    before = grace.get(path).text
    assert all(criterion.title in words(before) for criterion in asks.criteria)
    submit(grace, f"{HOME}/assignments", dict(re.findall(r'name="(assignment)" value="([^"]+)"', before)))
    assert f'href="{HOME}/assignments/echo-responder"' in grace.get(path).text
    assert 'name="assignment"' not in grace.get(path).text
    assert grace.get(f"{HOME}/catalogue/nothing-like-this").status_code == 422
