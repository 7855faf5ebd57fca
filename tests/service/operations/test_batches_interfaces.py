"""Each operation on batches and grades by page, API and command: equal rows, log entries and notices to workers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import func, or_, select, update
from starlette.testclient import TestClient

import acting
import report_builders
from builders import grading_request
from service.command_line import load_command
from service.queue.notifier import Notifier
from service.store.batches import intake
from service.store.ids import new_id
from service.store.models import Audit, Batch, Job, SubmissionRow
from service.store.states import JobState
from sim.errors import UsageError
from web import COURSE, Web, grade_all, submit, web_in
from zips import zipped

INTERFACES = ("page", "api", "command")


@dataclass(frozen=True)
class Action:
    """One operation by each of its interfaces, on a batch or a grade in a state that allows or forbids it."""

    command: str
    page: str
    state: str = "done"  # of the batch's jobs before
    api: str = ""  # where it is not as the page's
    sent: dict[str, Any] | None = None
    refused: bool = False


PAUSE, RESUME, CANCEL = "batches/{batch}/pause", "batches/{batch}/resume", "batches/{batch}/cancel"
PUBLISH, REGRADE, REGRADES = "batches/{batch}/publish", "batches/{batch}/regrade", "batches/{batch}/regrades"
ACTIONS = {
    "pause": Action("batch pause {batch}", PAUSE, "queued"),
    "pause again": Action("batch pause {batch}", PAUSE, "paused"),
    "pause no such batch": Action("batch pause nothing", "batches/nothing/pause", refused=True),
    "resume": Action("batch resume {batch}", RESUME, "paused"),
    "resume cancelled": Action("batch resume {batch}", RESUME, "cancelled", refused=True),
    "cancel": Action("batch cancel {batch}", CANCEL, "queued"),
    "cancel nothing": Action("batch cancel {batch}", CANCEL),
    "retry": Action("batch retry {batch}", "batches/{batch}/retry", "dead"),
    "regrade": Action("batch regrade {batch}", REGRADE, api=REGRADES),
    "regrade nothing": Action("batch regrade {batch}", REGRADE, "queued", REGRADES, refused=True),
    "regrade by another assignment": Action(
        "batch regrade {batch} -a first-program",
        REGRADE,
        api=REGRADES,
        sent={"assignment": "first-program"},
        refused=True,
    ),
    "regrade by an unknown assignment": Action(
        "batch regrade {batch} -a typo", REGRADE, api=REGRADES, sent={"assignment": "typo"}, refused=True
    ),
    "publish": Action("batch publish {batch}", PUBLISH),
    "publish regrades": Action("batch publish {batch}", PUBLISH, "regraded"),
    "publish anyway": Action("batch publish {batch} --anyway", PUBLISH, sent={"anyway": True}),
    "publish one": Action("batch publish-one {job}", "grades/{job}/publish"),
    "publish no such grade": Action("batch publish-one nothing", "grades/nothing/publish", refused=True),
}


@dataclass(frozen=True)
class Outcome:
    """Everything that an operation leaves behind; who did it, and random ids, left out."""

    accepted: bool
    jobs: list[tuple[Any, ...]]
    batches: list[tuple[Any, ...]]
    log: list[tuple[Any, ...]]
    notices: list[tuple[str, int]]


@dataclass(frozen=True)
class Asking:
    """An instructor with a browser and a program."""

    web: Web
    browser: TestClient
    program: TestClient
    token: dict[str, str]
    heard: list[tuple[str, int]]


@pytest.fixture(scope="module")
def asking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Asking]:
    home, heard = tmp_path_factory.mktemp("home"), list[tuple[str, int]]()
    with pytest.MonkeyPatch.context() as patching, web_in(home) as web:
        patching.setattr(Notifier, "grade", lambda _self, lane, count=1: heard.append((lane.value, count)))
        patching.setattr("service.queue.broker.broker_answers", lambda _settings: True)
        patching.setattr("service.queue.logs.configure_logging", lambda _level: None)
        patching.setenv("ROBOMARK_HOME", str(home))
        grace = web.instructor()
        yield Asking(web, web.browser(grace), web.browser(), web.token(grace, "submit", "mark"), heard)


@pytest.mark.parametrize("name", ACTIONS)
def test_an_operation_is_the_same_by_every_interface(asking: Asking, name: str) -> None:
    outcomes = {interface: _outcome(asking, ACTIONS[name], interface) for interface in INTERFACES}
    assert outcomes["page"] == outcomes["api"] == outcomes["command"]
    assert outcomes["page"].accepted is not ACTIONS[name].refused


def _outcome(asking: Asking, action: Action, interface: str) -> Outcome:
    values = _prepared(asking.web, action.state)
    with asking.web.store.reading() as session:
        seen = session.scalar(select(func.max(Audit.id))) or 0
    asking.heard.clear()
    accepted = _ask(asking, action, interface, values)
    return _left(asking, accepted, seen, values["batch"])


def _prepared(web: Web, state: str) -> dict[str, str]:
    """Two submissions in this state, of students without any other."""
    asked = [grading_request(who, f"print({who!r})\n") for who in (f"{name}-{new_id()}" for name in ("ada", "bob"))]
    batch = intake.accept_batch(web.store, "week one", asked, (), course=COURSE, max_attempts=3)
    if state in ("done", "regraded"):
        grade_all(web, report_builders.faulty_grade())
    if state == "regraded":
        acting.publish(web.store, batch.id, anyway=True)
        acting.regrade(web.store, batch.id)
        grade_all(web, report_builders.faulty_grade())
    if state == "paused":
        acting.pause(web.store, batch.id)
    if state == "cancelled":
        acting.cancel(web.store, batch.id)
    if state == "dead":
        with web.store.transaction() as session:
            session.execute(
                update(Job).where(Job.batch_id == batch.id).values(state=JobState.DEAD, error="the worker ended")
            )
    return {"batch": batch.id, "job": batch.jobs[0].job_id}


def _ask(asking: Asking, action: Action, interface: str, values: dict[str, str]) -> bool:
    """Whether the operation was accepted."""
    if interface == "page":
        path = f"/courses/1/{action.page.format(**values)}"
        return submit(asking.browser, path, action.sent).status_code == 303
    if interface == "api":
        path = f"/api/v1/courses/1/{(action.api or action.page).format(**values)}"
        return asking.program.post(path, json=action.sent, headers=asking.token).is_success
    group, name, *rest = action.command.format(**values).split()
    try:
        load_command(group, name).main(rest, standalone_mode=False)
    except UsageError:
        return False
    return True


def _left(asking: Asking, accepted: bool, seen: int, batch_id: str) -> Outcome:
    with asking.web.store.reading() as session:
        of_batch = or_(Batch.id == batch_id, Batch.regrade_of == batch_id)
        batches = session.scalars(select(Batch).where(of_batch).order_by(Batch.created_at, Batch.id)).all()
        query = select(Job).join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        of_students = query.where(SubmissionRow.batch_id == batch_id).order_by(SubmissionRow.source)
        gradings = session.scalars(of_students.order_by(Job.queued_at, Job.id)).all()
        known = {each.id: f"batch {number}" for number, each in enumerate(batches)}
        known |= {each.id: f"job {number}" for number, each in enumerate(gradings)}
        log = session.scalars(select(Audit).where(Audit.id > seen).order_by(Audit.id)).all()
        return Outcome(
            accepted,
            [
                (
                    known.get(each.batch_id or ""),
                    known.get(each.regrade_of or ""),
                    each.state,
                    each.standing,
                    each.lane,
                    each.attempt,
                    each.published_at is not None,
                )
                for each in gradings
            ],
            [(each.name, each.state, known.get(each.regrade_of or "")) for each in batches],
            [
                (
                    each.action,
                    each.subject,
                    known.get(each.subject_id),
                    {name: known.get(value, value) for name, value in each.detail.items()},
                )
                for each in log
                if each.actor
            ],
            [each for each in asking.heard if each[1]],
        )


@pytest.mark.parametrize("readable", [True, False])
def test_a_batch_is_submitted_the_same_by_every_interface(asking: Asking, tmp_path: Path, readable: bool) -> None:
    outcomes = {interface: _submitted(asking, tmp_path, interface, readable) for interface in INTERFACES}
    assert outcomes["page"] == outcomes["api"] == outcomes["command"]
    accepted, log, notices = outcomes["page"]
    assert accepted is readable
    assert (len(log), notices) == ((1, [("batch", 1)]) if readable else (0, []))


def _submitted(asking: Asking, folder: Path, interface: str, readable: bool) -> tuple[bool, list[Any], list[Any]]:
    """Whether a zip was accepted, the log entries without their ids, and the notices."""
    who = f"eve{new_id()}"
    files = {f"{who}/robot.py": f"print({who!r})\n", f"{who}/responder.py": "def responder(msg):\n    return msg\n"}
    data = zipped(files if readable else {"notes.txt": "nothing"})
    with asking.web.store.reading() as session:
        seen = session.scalar(select(func.max(Audit.id))) or 0
    asking.heard.clear()
    accepted = _submit_batch(asking, folder, interface, data)
    with asking.web.store.reading() as session:
        log = session.scalars(select(Audit).where(Audit.id > seen).order_by(Audit.id)).all()
        return (
            accepted,
            [(each.action, each.subject, each.detail) for each in log],
            [each for each in asking.heard if each[1]],
        )


def _submit_batch(asking: Asking, folder: Path, interface: str, data: bytes) -> bool:
    if interface == "page":
        sent = {"files": ("week.zip", data, "application/zip")}
        uploads = "/courses/1/batches/uploads"
        answer = submit(asking.browser, uploads, {"assignment": "echo-responder"}, files=sent)
        if answer.status_code != 303:
            return False
        return submit(asking.browser, f"{answer.headers['location']}/confirm").status_code == 303
    if interface == "api":
        path = "/api/v1/courses/1/batches?name=week.zip&assignment=echo-responder"
        headers = asking.token | {"content-type": "application/zip"}
        return asking.program.post(path, content=data, headers=headers).is_success
    (folder / "week.zip").write_bytes(data)
    try:
        words = [str(folder / "week.zip"), "-a", "echo-responder"]
        load_command("batch", "submit").main(words, standalone_mode=False)
    except UsageError:
        return False
    return True
