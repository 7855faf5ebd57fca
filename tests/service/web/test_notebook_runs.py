"""The API of notebooks: runs to the next question, checks, waiting, and nothing else for a token that may submit."""

from __future__ import annotations

import io
import json
import threading
import time
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from httpx2 import Response
from starlette.testclient import TestClient

from builders import echo
from notebook_builder import document
from paths import DATA
from service.grading.notebook_runs import NEW_NOTEBOOK_PAGE
from service.grading.trial_runner import TrialRunner
from service.notebook_engine.requests import page_to_json
from service.queue import notebook_job
from service.queue.test_run_job import run_next_test
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.student_export import export_student
from submissions.assignment.examples import locate_examples
from web import Web, web_in
from web_world import filled, make_world

RUNS = "/api/v1/courses/1/mine/notebook-runs"
REQUEST: dict[str, Any] = {
    "cell": 2,
    "name": "sim_magic_preloaded",
    "arguments": "-b Loop -L -R",
    "body": "import time\nprint('PY::one')\ntime.sleep(0.5)\nprint('PY::two')\ntime.sleep(0.5)\n",
    "page": None,
    "seed": 3,
    "answers": [],
}
PAGE = page_to_json(NEW_NOTEBOOK_PAGE)


@dataclass(frozen=True, slots=True)
class Notebook:
    """A student's notebook on a server without a worker process, which runs when it is told to."""

    web: Web
    client: TestClient
    token: dict[str, str]
    runner: TrialRunner

    def post(self, path: str = "", **options: Any) -> Response:
        headers = self.token | options.pop("headers", {})
        return self.client.post(f"{RUNS}{path}", headers=headers, **options)

    def get(self, path: str, **options: Any) -> Response:
        return self.client.get(f"{RUNS}/{path}", headers=self.token, **options)

    def work(self) -> None:
        assert run_next_test(self.web.store, self.web.settings, self.runner)

    def perform(self, **changes: Any) -> dict[str, Any]:
        """Return the result of a request, after a worker has performed it."""
        started = self.post(json=REQUEST | changes)
        assert started.status_code == 201, started.text
        self.work()
        state = self.get(started.json()["id"]).json()
        assert (state["state"], state["refused"], state["error"]) == ("done", "", ""), state
        result: dict[str, Any] = state["result"]
        return result


@pytest.fixture
def notebook(tmp_path_factory: pytest.TempPathFactory, runner: TrialRunner) -> Iterator[Notebook]:
    with web_in(tmp_path_factory.mktemp("home")) as web:
        ada = web.student("ada")
        with web.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, "echo-responder")
        yield Notebook(web, web.browser(), web.token(ada, "submit"), runner)


def test_a_run_ends_at_each_question_and_repeats_with_its_answer(notebook: Notebook) -> None:
    first = notebook.perform()["question"]
    assert (first["number"], first["text"]) == (0, "PY::one")
    second = notebook.perform(answers=["heard"])["question"]
    assert (second["number"], second["text"], second["t"] >= 0.5) == (1, "PY::two", True)
    result = notebook.perform(answers=["heard", None])
    run = result["run"]
    assert (run["verdict"], run["seconds"]) == ("protocol_error", pytest.approx(1.0, abs=0.1))
    assert [fault["who"] for fault in run["faults"]] == ["responder"]
    next_one = notebook.perform(page=result["page"], name="sim_magic", arguments="-R", body=None)
    assert next_one["run"]["sha256"]


def test_a_magic_without_a_run_returns_the_page(notebook: Notebook) -> None:
    result = notebook.perform(arguments="-b Loop -x 300", body=None, name="sim_magic")
    assert (result["run"], result["page"]["x"], result["page"]["background"]) == (None, 300, "Loop")


def test_a_program_that_computes_for_ever_is_stopped(notebook: Notebook, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notebook_job, "_PROGRAM", replace(notebook_job._PROGRAM, cpu_seconds=0.3))
    assert notebook.perform(body="while True:\n    pass\n")["run"]["verdict"] == "cpu_limit"


@pytest.mark.parametrize(
    "change",
    [
        {"page": PAGE | {"background": "nowhere"}},
        {"page": PAGE | {"obstacles": [[0, 0, 9000, 9000]]}},
        {"page": PAGE | {"x": 1e300}},
        {"page": {"background": "Loop"}},
        {"answers": ["x"] * 201},
        {"answers": [3]},
        {"answers": None},
        {"seed": -1},
        {"cell": "1"},
        {"verdict": "finished"},
    ],
)
def test_hostile_requests_are_refused(notebook: Notebook, change: dict[str, Any]) -> None:
    refused = notebook.post(json=REQUEST | change)
    assert refused.status_code == 422, refused.text
    assert refused.json()["detail"]


def test_a_request_is_limited_in_size(notebook: Notebook) -> None:
    assert notebook.post(json=REQUEST | {"answers": ["x" * (2 << 20)]}).status_code == 413


def test_a_student_has_one_at_a_time_and_a_repeated_request_is_the_same(notebook: Notebook) -> None:
    key = {"idempotency-key": "a1"}
    started = notebook.post(json=REQUEST, headers=key)
    again = notebook.post(json=REQUEST, headers=key)
    assert again.json()["id"] == started.json()["id"]
    busy = notebook.post(json=REQUEST)
    assert (busy.status_code, "not completed yet" in busy.json()["detail"]) == (409, True)
    assert notebook.get(started.json()["id"]).json()["result"] is None


def test_a_wait_ends_when_the_run_has_ended(notebook: Notebook) -> None:
    run_id = notebook.post(json=REQUEST).json()["id"]
    assert notebook.get(run_id, params={"wait": 0.01}).json()["state"] == "queued"
    begun = time.monotonic()
    working = threading.Timer(0.3, notebook.work)
    working.start()
    state = notebook.get(run_id, params={"wait": 20}).json()
    working.join()
    assert (state["state"], time.monotonic() - begun < 20) == ("done", True)
    assert notebook.get(run_id, params={"wait": 21}).status_code == 422


def test_nobody_else_sees_a_run(notebook: Notebook) -> None:
    run_id = notebook.post(json=REQUEST).json()["id"]
    notebook.work()
    bob = notebook.web.token(notebook.web.student("bob"), "submit", "read")
    assert notebook.get(run_id).json()["result"]
    assert notebook.client.get(f"{RUNS}/{run_id}", headers=bob).status_code == 404
    grace = notebook.web.token(notebook.web.instructor("grace"), "submit", "read")
    assert notebook.client.post(RUNS, json=REQUEST, headers=grace).status_code == 404


def _check(notebook: Notebook, cells: list[str], assignment: str = "echo-responder") -> Response:
    files = [("files", ("ada.ipynb", json.dumps(document(cells)).encode()))]
    return notebook.post(f"/checks?assignment={assignment}", files=files)


def test_a_notebook_is_checked_without_an_attempt(notebook: Notebook) -> None:
    example = locate_examples("echo-responder") / "reference"
    cells = [
        (example / "responder.py").read_text() + "\nroboSim.pyresponder = responder",
        "%%sim_magic_preloaded -R\n" + (example / "robot.py").read_text(),
    ]
    started = _check(notebook, cells)
    assert (started.status_code, started.json()["kind"]) == (201, "check"), started.text
    notebook.work()
    check = notebook.get(started.json()["id"]).json()["result"]
    assert (check["marks"], all(each["passed"] for each in check["criteria"])) == (check["out_of"], True)
    reading = notebook.web.token(notebook.web.student("ada"), "read")
    assert notebook.client.get("/api/v1/courses/1/mine/submissions", headers=reading).json()["items"] == []


def test_a_check_needs_an_open_assignment_and_a_notebook(notebook: Notebook) -> None:
    assert _check(notebook, ["1"], "lollipop").status_code == 404
    assert "does not" in _check(notebook, ["1"]).json()["detail"] or _check(notebook, ["1"]).status_code == 422
    with notebook.web.store.transaction() as session:
        open_assignments.close_assignment(session, 1, "echo-responder")
    closed = _check(notebook, ["%%sim_magic_preloaded -R\nprint(1)\n"])
    assert (closed.status_code, "is closed" in closed.json()["detail"]) == (422, True)


@pytest.mark.long
def test_a_students_token_that_may_submit_can_do_nothing_else(tmp_path: Path) -> None:
    with web_in(tmp_path) as web:
        world = make_world(web)
        token, client = web.token(world.ada, "submit"), web.browser()
        table = tomllib.loads((DATA / "access" / "api.toml").read_text())
        for route, who in table.items():
            method, path = route.split(" ")
            reader, *scope = who.split(" ")
            answer = client.request(method, filled(path, world.values), headers=token)
            if scope == ["submit"] and reader in ("student", "owner", "member"):
                assert answer.status_code not in (401, 403, 404), (route, answer.text)
            elif scope:
                assert answer.status_code in (403, 404), (route, answer.status_code)


def test_a_students_export_has_their_runs_and_checks(notebook: Notebook) -> None:
    notebook.perform()
    _check(notebook, ["%%sim_magic_preloaded -R\nprint(1)\n"])
    enrolment_id = notebook.web.student("ada").enrolment_id
    with zipfile.ZipFile(io.BytesIO(export_student(notebook.web.store, enrolment_id))) as archive:
        names = [name for name in archive.namelist() if name.startswith("test-runs/")]
        result = json.loads(archive.read("test-runs/_notebook-run-1/result.json"))
    # The request of a run is deleted as soon as there is another one.
    assert names == ["test-runs/_notebook-run-1/result.json", "test-runs/_notebook-check-2/submission.zip"]
    assert result["question"]["text"] == "PY::one"
    hidden = export_student(notebook.web.store, enrolment_id, {"echo-responder"})
    with zipfile.ZipFile(io.BytesIO(hidden)) as archive:
        assert not [name for name in archive.namelist() if "check" in name]
