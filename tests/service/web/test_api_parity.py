"""Page actions are available to programs: own assignments, test runs, grades, batches, platforms, students."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from httpx2 import Response
from starlette.testclient import TestClient

from service.store.queue import test_runs
from service.store.tables.submissions import Job
from submissions.assignment.export import create_assignment
from web import Web, web_in
from web_world import World, make_world
from zips import zipped

HERE = "/api/v1/courses/1"
ECHO = {"robot.py": "print('hello')\n", "responder.py": "def responder(msg):\n    return msg\n"}


@dataclass(frozen=True, slots=True)
class Programs:
    """A world, and the programs of its members."""

    web: Web
    world: World
    client: TestClient
    tokens: dict[str, dict[str, str]]

    def ask(self, who: str, method: str, path: str, **options: Any) -> Response:
        headers = self.tokens[who] | options.pop("headers", {})
        return self.client.request(method, path if path.startswith("/api") else HERE + path, headers=headers, **options)


@pytest.fixture
def programs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Programs]:
    with web_in(tmp_path_factory.mktemp("home")) as web:
        world = make_world(web)
        members = {"grace": world.grace, "ada": world.ada, "bob": web.student("bob"), "root": web.operator()}
        tokens = {who: web.token(each, "read", "submit", "mark", "manage") for who, each in members.items()}
        yield Programs(web, world, web.browser(), tokens)


def test_an_assignment_of_ones_own_is_checked_prepared_and_previewed(
    programs: Programs, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("own") / "mine"
    create_assignment(folder)
    files = {f"mine/{each.relative_to(folder)}": each.read_bytes() for each in folder.rglob("*") if each.is_file()}
    send = {"headers": {"content-type": "application/zip"}}
    made = programs.ask("grace", "POST", "/assignments/uploads", content=zipped(files), **send)
    assert (made.status_code, made.json()["open"]) == (201, False), made.text
    document = programs.ask("grace", "GET", f"/assignments/{made.json()['id']}").json()
    assert [each["marks"] for each in document["criteria"]]
    assert document["has_reference"] is False  # from the catalogue
    broken = files | {"mine/assignment.toml": b"id = 7\n"}
    answer = programs.ask("grace", "POST", "/assignments/uploads", content=zipped(broken), **send)
    assert (answer.status_code, "assignment.toml" in answer.json()["detail"]) == (422, True)
    programs.ask("grace", "POST", "/assignments", json={"assignment": "first-program"})
    job = programs.ask("grace", "POST", "/assignments/first-program/preview").json()["job"]
    assert programs.ask("grace", "GET", f"/grades/{job}/state").json()["state"] == "queued"


def test_a_program_is_tried_by_its_owner_alone(programs: Programs) -> None:
    files = [("files", (name, text.encode())) for name, text in ECHO.items()]
    path = "/mine/tryouts"
    response = programs.ask("ada", "POST", f"{path}?assignment=echo-responder", files=files)
    assert (response.status_code, response.json()["state"], response.json()["said"]) == (201, "queued", None), (
        response.text
    )
    again = programs.ask("ada", "POST", f"{path}?assignment=echo-responder", files=files)
    assert (again.status_code, "not completed yet" in again.json()["detail"]) == (422, True)
    own = f"{path}/{response.json()['id']}"
    assert programs.ask("ada", "GET", f"{own}/replay").status_code == 404
    claimed = test_runs.claim_test_run(programs.web.store, 60)
    assert claimed is not None
    test_runs.finish_test_run(programs.web.store, claimed, {"happened": "It ended."}, None)
    done = programs.ask("ada", "GET", own).json()
    assert (done["state"], done["said"]) == ("done", {"happened": "It ended."})
    assert programs.ask("bob", "GET", own).status_code == 404
    kept = programs.world.values["tryout_id"]
    assert programs.ask("ada", "GET", f"{path}/{kept}/replay").json() == {}


def test_one_grade_is_published_and_graded_again(programs: Programs) -> None:
    job = programs.world.values["job_id"]
    document = programs.ask("ada", "GET", "/mine/submissions/1").json()
    assert (document["published"], document["job"], document["place"]) == (False, job, None)
    assert programs.ask("grace", "POST", f"/grades/{job}/publish").json()["published"] == 1
    assert programs.ask("ada", "GET", "/mine/submissions/1").json()["published"] is True
    made = programs.ask("grace", "POST", f"/grades/{job}/regrades")
    assert made.status_code == 201, made.text
    with programs.web.store.reading() as session:
        assert session.get_one(Job, made.json()["job"]).submission_id == 1


def test_a_batch_is_looked_at_before_and_after(programs: Programs) -> None:
    data = zipped({f"{who}/{name}": t.encode() for who in ("ada", "cyd") for name, t in ECHO.items()} | {"eve/x": b""})
    send = {"headers": {"content-type": "application/zip"}, "content": data}
    before = programs.ask("grace", "GET", "/batches").json()
    document = programs.ask("grace", "POST", "/batches/preflight?assignment=echo-responder", **send).json()
    assert {each["student"]: each["enrolled"] for each in document["submissions"]} == {"ada": True, "cyd": False}
    assert [each["source"] for each in document["refusals"]] == ["eve"]
    assert programs.ask("grace", "GET", "/batches").json() == before
    batch = f"/batches/{programs.world.values['batch_id']}"
    (seen,) = programs.ask("grace", "GET", f"{batch}/overview?pass=0").json()["classes"]
    assert (seen["passed"], sum(each["count"] for each in seen["distribution"])) == (1, 1)
    assert "bob" in [each["id"] for each in seen["missing"]]
    assert (seen["quality"]["n"], seen["quality"]["findings"]) == (1, [])
    assert programs.ask("grace", "GET", f"{batch}/publish").json()["counts"]["published"] == 1


def test_a_student_reads_what_is_asked_for_and_what_is_given(programs: Programs) -> None:
    sheet = programs.ask("ada", "GET", "/mine/assignments/echo-responder").json()
    assert (sheet["asked"], sheet["given"]) == (["robot.py", "responder.py"], ["notes.txt"])
    assert programs.ask("ada", "GET", "/mine/assignments/echo-responder/given/notes.txt").text == "counts from 0"
    for missing in ("lollipop", "echo-responder/given/robot.py"):
        assert programs.ask("ada", "GET", f"/mine/assignments/{missing}").status_code == 404


def test_one_student_with_grades_unless_names_are_hidden(programs: Programs) -> None:
    path = f"/people/{programs.world.ada.enrolment_id}"
    assert [each["attempt"] for each in programs.ask("grace", "GET", path).json()["gradings"]] == [1]
    programs.ask("grace", "POST", "/assignments/echo-responder/names", json={"names_hidden": True})
    document = programs.ask("grace", "GET", path).json()
    assert (document["gradings"], document["some_hidden"]) == ([], True)


def test_platforms_are_registered_and_asked_for_members(programs: Programs) -> None:
    addresses = {f"{each}_url": f"https://moodle.example.org/{each}" for each in ("authorization", "token", "keys")}
    registration = {
        "name": "Moodle",
        "issuer": "https://moodle.example.org",
        "client_id": "x",
        "deployments": ["1"],
    } | addresses
    assert (
        programs.ask("root", "POST", "/api/v1/operator/platforms", json=registration).json()["items"][0]["name"]
        == "Moodle"
    )
    bad = registration | {"token_url": "file:///etc/passwd"}
    assert programs.ask("root", "POST", "/api/v1/operator/platforms", json=bad).status_code == 422
    assert programs.ask("grace", "GET", "/platform").json() == {"name": None, "members": False, "marks": False}
    assert programs.ask("grace", "POST", "/platform/members").status_code == 422
    made = programs.ask("root", "POST", "/api/v1/operator/courses", json={"course": "TM129", "id": "linus"}).json()
    assert programs.client.post("/sign-in", data={"secret": made["link"]["path"]}).status_code == 303
