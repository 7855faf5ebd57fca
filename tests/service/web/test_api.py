"""Answers to programs: idempotency keys, pagination, ETags, problem details; and how routes use the store."""

from __future__ import annotations

import base64
import io
import json
import re
import zipfile
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from httpx2 import Response
from jsonschema_rs import validator_for
from starlette.testclient import TestClient

import report_builders
from builders import echo, grading_request, release_at_once
from service.operations import replies
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.hidden_names import load_hidden_names
from service.store.grades import results
from service.store.people import membership
from service.store.people.credentials import identify
from service.store.queue import jobs
from service.store.states import CredentialKind
from service.web.access import build_actor
from service.web.api_uploads import MAX_BATCH_BYTES
from web import COURSE, Web, submit, web_in

EVERYTHING = ("read", "submit", "mark", "manage")
HERE = "/api/v1/courses/1"


@dataclass(frozen=True, slots=True)
class Program:
    """Somebody's token, and a client that uses it."""

    client: TestClient
    token: dict[str, str]

    def ask(self, method: str, path: str, headers: dict[str, str] | None = None, **options: Any) -> Response:
        return self.client.request(method, f"{HERE}{path}", headers=self.token | (headers or {}), **options)


@pytest.fixture
def grace(web: Web) -> Program:
    return Program(web.browser(), web.token(web.instructor(), *EVERYTHING))


@pytest.fixture
def ada(web: Web) -> Program:
    return Program(web.browser(), web.token(web.student(), *EVERYTHING))


def zipped(**students: str) -> bytes:
    """Return a batch: a robot program and an echo responder for each student."""
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for student, program in students.items():
            archive.writestr(f"{student}/robot.py", program)
            archive.writestr(f"{student}/responder.py", "def responder(msg):\n    return msg\n")
    return sink.getvalue()


def upload(program: Program, data: bytes, name: str = "week", **headers: str) -> Response:
    sent_headers = {
        "content-type": "application/zip",
        **{key.replace("_", "-"): value for key, value in headers.items()},
    }
    path = f"/batches?name={name}&assignment=echo-responder"
    return program.ask("POST", path, sent_headers, content=data)


def graded(web: Web) -> str:
    """Create a batch of one graded submission; return its job."""
    batch = intake.accept_batch(web.store, "week", [grading_request("ada")], (), course=COURSE, max_attempts=1)
    claim = jobs.claim_job(web.store, "worker", 60)
    assert claim is not None
    grade = report_builders.faulty_grade()
    trials = tuple(replace(each, visibility="hidden") for each in grade.trials)
    kept = replace(grade.criteria[-1], visibility="after_published", for_staff="look here")
    hidden = replace(grade, trials=trials, criteria=(*grade.criteria[:-1], kept))
    jobs.finish_job(web.store, claim, results.prepare_grade(hidden), datetime.now(UTC))
    return batch.jobs[0].job_id


def test_a_batch_is_handed_over_watched_and_written_out(web: Web, grace: Program) -> None:
    answer = upload(grace, zipped(ada="print('hello')\n", bob="print('hullo')\n"))
    assert answer.status_code == 201, answer.text
    taken = answer.json()
    assert (taken["queued"], taken["refusals"]) == (2, [])
    path = f"/batches/{taken['batch']}"
    assert grace.ask("POST", f"{path}/pause").json() == {"changed": True, "waiting": 2, "running": 0}
    assert grace.ask("GET", path).json()["state"] == "paused"
    assert [each["student"] for each in grace.ask("GET", f"{path}/grades").json()["items"]] == ["ada", "bob"]
    rows = grace.ask("GET", f"{path}/export?format=csv").text.splitlines()
    assert len(rows) == 3
    packed = grace.ask("GET", f"{path}/export?format=text")
    assert packed.headers["content-type"] == "application/zip"
    assert "gradescope" in grace.ask("GET", f"{path}/export?format=nothing").json()["detail"]
    again = upload(grace, zipped(ada="print('hello')\n", bob="print('hullo')\n")).json()
    assert (again["batch"], [each["student"] for each in again["known"]]) == (None, ["ada", "bob"])


def test_the_same_request_with_its_key_is_done_once(web: Web, grace: Program) -> None:
    students = {"students": [{"id": "cyd", "name": "Cyd"}]}
    first = grace.ask("POST", "/people", {"idempotency-key": "k1"}, json=students)
    second = grace.ask("POST", "/people", {"idempotency-key": "k1"}, json=students)
    assert (first.status_code, first.content) == (second.status_code, second.content)
    assert (first.headers.get("idempotent-replay"), second.headers.get("idempotent-replay")) == (None, "true")
    other = grace.ask("POST", "/people", {"idempotency-key": "k1"}, json={"students": [{"id": "dan"}]})
    assert other.status_code == 422
    assert "another request" in other.json()["detail"]
    batch = zipped(ada="print(1)\n")
    made = [upload(grace, batch, idempotency_key="k2").json()["batch"] for _ in range(2)]
    assert made[0] == made[1] is not None
    assert len(grace.ask("GET", "/batches").json()["items"]) == 1


def test_a_key_is_its_owners_alone_and_free_again_after_a_fault(web: Web, grace: Program, ada: Program) -> None:
    students = {"students": [{"id": "cyd"}]}
    assert grace.ask("POST", "/people", {"idempotency-key": "k"}, json={"students": []}).status_code == 422
    assert grace.ask("POST", "/people", {"idempotency-key": "k"}, json=students).status_code == 201
    assert ada.ask("POST", "/people", {"idempotency-key": "k"}, json=students).status_code == 404
    assert grace.ask("POST", "/people", {"idempotency-key": "\x7f"}, json=students).status_code == 422


def test_of_two_requests_at_once_the_second_is_told_to_wait(web: Web, grace: Program) -> None:
    with web.store.reading() as session:
        identity = identify(session, grace.token["authorization"].removeprefix("Bearer "), CredentialKind.TOKEN)
    assert identity is not None
    # A key belongs to one caller in one role.
    assert replies.reserve_key(web.app.state.context.service, build_actor(identity), "instructor k") is None
    answer = grace.ask("POST", "/people", {"idempotency-key": "k"}, json={"students": [{"id": "cyd"}]})
    assert (answer.status_code, answer.headers["retry-after"]) == (409, "5")


def test_lists_come_in_pages_that_miss_and_double_nothing(web: Web, grace: Program) -> None:
    requests = [grading_request(f"s{number}", f"print({number})\n") for number in range(5)]
    for number in range(5):
        intake.accept_batch(web.store, f"b{number}", requests, (), course=COURSE, max_attempts=1)
    (batch, *_) = grace.ask("GET", "/batches?limit=1").json()["items"]
    for path, key in (("/batches", "id"), ("/people", "enrolment"), (f"/batches/{batch['id']}/grades", "id")):
        whole = [each[key] for each in grace.ask("GET", f"{path}?limit=200").json()["items"]]
        assert len(whole) >= 5
        items, after = [], ""
        while after is not None:
            page = grace.ask("GET", path, params={"limit": 2, "after": after}).json()
            assert len(page["items"]) <= 2
            items += [each[key] for each in page["items"]]
            after = page["next"]
        assert items == whole
    for nonsense in ("x", "bnVsbA", "WzFd", "W10", "ä"):
        answer = grace.ask("GET", "/batches", params={"after": nonsense})
        assert answer.status_code == 422, nonsense


def test_what_is_wrong_is_a_problem(web: Web, grace: Program) -> None:
    big = {"content-length": str(MAX_BATCH_BYTES + 1), "content-type": "application/zip"}
    answers = {
        404: grace.client.get("/api/v1/nothing"),
        405: grace.client.delete("/api/v1/me", headers=grace.token),
        401: grace.client.get("/api/v1/me"),
        413: grace.ask("POST", "/batches", big, content=b""),
        415: grace.ask("POST", "/batches", {"content-type": "text/plain"}, content=b"x"),
        422: upload(grace, b"no zip"),
    }
    for status, answer in answers.items():
        assert answer.status_code == status, answer.text
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["status"] == status
        assert answer.json()["detail"].endswith("." if status != 401 else "...")
    assert answers[405].headers["allow"] == "GET"


def test_whoever_asks_too_often_waits(tmp_path: Path) -> None:
    with web_in(tmp_path, api_calls_per_minute=2) as web:
        program = Program(web.browser(), web.token(web.instructor(), *EVERYTHING))
        statuses = [program.ask("GET", "/batches").status_code for _ in range(3)]
        assert statuses == [200, 200, 429]
        other = Program(program.client, web.token(web.instructor(), *EVERYTHING))
        assert other.ask("GET", "/batches").status_code == 200


def test_a_student_sees_of_a_grade_what_is_released_and_staff_all_of_it(web: Web, grace: Program, ada: Program) -> None:
    job = graded(web)
    release_at_once(web.store)
    whole = grace.ask("GET", f"/grades/{job}")
    mine = ada.ask("GET", "/mine/submissions/1/grade")
    assert whole.json()["trials"]
    assert not whole.json()["withheld"]
    assert (mine.json()["trials"], mine.json()["withheld"]) == ([], True)
    assert len(mine.json()["criteria"]) == len(whole.json()["criteria"]) - 1
    assert "look here" in whole.text
    for part in ("grade", "report", "replay"):
        assert "look here" not in ada.ask("GET", f"/mine/submissions/1/{part}").text
    batch = grace.ask("GET", "/batches").json()["items"][0]["id"]
    assert grace.ask("POST", f"/batches/{batch}/publish").json()["published"] == 1
    released = ada.ask("GET", "/mine/submissions/1/grade").json()
    assert len(released["criteria"]) == len(whole.json()["criteria"])
    assert "look here" not in json.dumps(released)


def test_what_is_known_is_not_sent_again(web: Web, grace: Program) -> None:
    job = graded(web)
    for part in ("", "/report", "/replay"):
        first = grace.ask("GET", f"/grades/{job}{part}")
        assert first.status_code == 200
        again = grace.ask("GET", f"/grades/{job}{part}", {"if-none-match": first.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")
        compressed = grace.ask("GET", f"/grades/{job}{part}", {"accept-encoding": "gzip"})
        assert compressed.headers["content-encoding"] == "gzip"
        assert compressed.headers["etag"] == first.headers["etag"]
        assert compressed.content == first.content


def test_where_names_are_hidden_nobody_is_named(web: Web, grace: Program) -> None:
    job = graded(web)
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.hide_names(session, 1, "echo-responder", True)
    batch = grace.ask("GET", "/batches").json()["items"][0]["id"]
    page_text = [grace.ask("GET", path).text for path in (f"/batches/{batch}/grades", f"/batches/{batch}")]
    page_text += [grace.ask("GET", f"/grades/{job}{part}").text for part in ("", "/state", "/report", "/replay")]
    assert [text for text in page_text if re.search(r"\bada\b", text, re.IGNORECASE)] == []
    called = load_hidden_names(web.store, 1).label_student("echo-responder", "ada")
    assert called.startswith("Participant ")
    assert called in page_text[0]
    assert grace.ask("GET", "/submissions/1/files").status_code == 404


def test_a_student_submits_what_is_open(web: Web, ada: Program) -> None:
    files = [
        ("files", ("robot.py", b"print('hello')\n")),
        ("files", ("responder.py", b"def responder(m):\n  return m\n")),
    ]
    path = "/mine/submissions?assignment=echo-responder"
    assert ada.ask("POST", path, files=files).status_code == 404
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.open_for_students(session, 1, "echo-responder")
    assert [each["id"] for each in ada.ask("GET", "/mine/assignments").json()["items"]] == ["echo-responder"]
    answer = ada.ask("POST", path, files=files)
    assert answer.status_code == 201, answer.text
    assert (answer.json()["attempt"], answer.json()["state"]) == (1, "queued")
    kept = ada.ask("GET", "/mine/submissions/1/files")
    with zipfile.ZipFile(io.BytesIO(kept.content)) as archive:
        assert archive.read("robot.py") == b"print('hello')\n"
    assert ada.ask("POST", path, data={"text": "x"}).status_code == 415
    assert ada.ask("GET", "/mine/submissions/1/grade").status_code == 404


def test_a_link_is_made_for_nobody_who_is_more_than_a_student_here(web: Web, grace: Program) -> None:
    member = web.student("ada")
    assert grace.ask("POST", f"/people/{member.enrolment_id}/link").json()["path"].startswith("/sign-in/rml_")
    with web.store.transaction() as session:
        membership.make_operator(session, member.person_id)
    assert grace.ask("POST", f"/people/{member.enrolment_id}/link").status_code == 422


def test_the_description_is_whole_and_its_examples_fit_it(web: Web) -> None:
    description = web.browser().get("/api/openapi.json").json()
    assert description["openapi"].startswith("3.1")
    operations = [
        operation
        for path, operations in description["paths"].items()
        if path.startswith("/api/v1/")
        for operation in operations.values()
    ]
    assert all(each["summary"] and each["description"] and each["security"] for each in operations)
    schemas = description["components"]["schemas"]
    for name, schema in schemas.items():
        validator = validator_for({**schema, "components": description["components"]})
        for example in schema.get("examples", []):
            assert not [error.message for error in validator.iter_errors(example)], name
    answered = {
        each["responses"][status]["content"]["application/json"]["schema"].get("$ref", "").rpartition("/")[2]
        for each in operations
        for status in ("200", "201")
        if "application/json" in each["responses"].get(status, {}).get("content", {})
    } - {""}
    without = {name for name in answered if not schemas[name].get("examples") and not name.startswith("Listed_")}
    assert without == set()


def test_a_token_made_on_the_page_is_one_and_stays_to_be_copied_until_it_is_used(web: Web) -> None:
    browser = web.browser(web.instructor())
    for _ in range(2):
        made = submit(browser, "/account/tokens", {"name": "script", "scopes": "read", "word": "once"})
        page_text = browser.get(made.headers["location"]).text
        assert page_text.count('<th scope="row">script</th>') == 1
    (secret,) = set(re.findall(r"rmt_[\w-]+", page_text))
    others = web.browser(web.instructor("mallory")).get(made.headers["location"]).text
    assert "rmt_" not in others
    assert Program(web.browser(), {"authorization": f"Bearer {secret}"}).ask("GET", "/batches").status_code == 200
    assert "rmt_" not in browser.get(made.headers["location"]).text


@pytest.mark.parametrize("text", ["\0", "\ud800", 7, None])
def test_a_cursor_with_text_that_no_database_accepts_is_refused(web: Web, text: object) -> None:
    token = web.token(web.instructor(), "read")
    cursor = base64.urlsafe_b64encode(json.dumps([text]).encode()).decode().rstrip("=")
    answer = web.browser().get(f"/api/v1/courses/1/assignments?after={cursor}", headers=token)
    assert (answer.status_code, answer.json()["detail"]) == (422, "after: expected the `next` of the previous page.")


def test_the_data_of_one_student_are_exported_at_a_time(
    web: Web, grace: Program, ada: Program, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.web.context._SLOT_SECONDS", 0.1)
    people = grace.ask("GET", "/people").json()["items"]
    enrolment = next(each["enrolment"] for each in people if each["id"] == "ada")
    with web.app.state.context.exporting:
        assert "download" in ada.ask("GET", "/mine/data").json()["detail"]
        assert grace.ask("GET", f"/people/{enrolment}/data").status_code == 503
    assert [ada.ask("GET", "/mine/data").status_code for _ in range(3)] == [200, 200, 429]
    assert [grace.ask("GET", f"/people/{enrolment}/data").status_code for _ in range(5)] == [200] * 5


def test_the_files_of_submissions_are_not_downloaded_without_end(web: Web, ada: Program) -> None:
    assert [ada.ask("GET", "/mine/submissions/99/files").status_code for _ in range(21)] == [404] * 20 + [429]
    page = "/courses/1/mine/submissions/99/files"
    assert web.browser(web.student()).get(page).status_code == 429
