"""The moderation sheet of a batch: its content, without hidden names, and without active content."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import pytest
from starlette.testclient import TestClient

import report_builders
from acting import machine, service_on
from builders import echo, grading_request
from report_builders import HOSTILE
from service.operations.errors import Invalid
from service.operations.moderation import download_sheet
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.engine import now
from service.store.grades import overrides
from service.store.tables.grades import Appeal
from service.store.tables.statements import StatementHead
from service.store.tables.submissions import Job
from submissions.assignment.reader import find_assignment
from web import COURSE, Web, grade_all, words

STUDENTS = ("ada", "bob", "cyd")
GRADE = replace(report_builders.shape_grade(), sandbox="Landlock 7, policy 0")
SHAPE, ALOUD = (result.id for result in GRADE.criteria)


def _make_batch(web: Web) -> str:
    """Create a graded batch with an override, a withdrawn one, an appeal, and a written head of the log."""
    requests = [grading_request(who) for who in STUDENTS]
    batch = intake.accept_batch(web.store, "week one", requests, (), course=COURSE, max_attempts=3)
    grade_all(web, GRADE)
    ada, bob, _ = (job.job_id for job in batch.jobs)
    with web.store.transaction() as session:
        overrides.set_marks(session, ada, SHAPE, Decimal("3.5"), f"seen again {HOSTILE}", "tess")
        overrides.excuse_criterion(session, bob, ALOUD, "no loudspeaker", "grace")
        overrides.withdraw_override(session, bob, ALOUD, "grace")
        job = session.get_one(Job, ada)
        times = {"asked_at": now(session), "answered_at": now(session)}
        session.add(
            Appeal(submission_id=job.submission_id, text="It was right.", answer="It was.", actor="tess", **times)
        )
        session.add(StatementHead(size=7, root_sha256="ab" * 32, made_at=now(session)))
    return batch.id


def test_the_sheet_contains_the_records_of_a_batch(web: Web, grace: TestClient) -> None:
    path = f"/courses/1/batches/{_make_batch(web)}"
    answer = grace.get(f"{path}/moderation?assignment=echo-responder")
    assert answer.headers["content-disposition"].startswith("attachment")
    assert "script-src" not in answer.text
    assert "<script" not in answer.text
    page_text = words(answer.text)
    for each in (
        "Moderation sheet: ",
        "Landlock 7, policy 0 3",
        "Figures on the task need at least 10 graded submissions; there are 3.",
        "ada 1 5.5 / 8",
        "adjusted by staff, not published",
        "5 3.5 seen again",
        "2 excused no loudspeaker grace, ",
        "; withdrawn 20",
        "It was right.",
        "It was. ",
        "7 entries, 20",
        "ab" * 32,
    ):
        assert each in page_text, each
    assert f'href="{path}/moderation?assignment=echo-responder"' in grace.get(path).text
    german = words(grace.get(f"{path}/moderation", headers={"accept-language": "de"}).text)
    assert "Wie gut ist die Aufgabe?" in german
    assert grace.get(f"{path}/moderation?assignment=lollipop").status_code == 404


def test_hidden_names_are_hidden_on_the_sheet_also_for_commands(web: Web, grace: TestClient) -> None:
    batch_id = _make_batch(web)
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.hide_names(session, 1, "echo-responder", True)
    by_page = grace.get(f"/courses/1/batches/{batch_id}/moderation").text
    service = service_on(web.store)
    by_command = download_sheet(service, machine(), 1, batch_id).data.decode()
    for page_text in (words(by_page), words(by_command)):
        assert page_text.count("Participant ") == 3 + 2 + 1
        assert not {*STUDENTS, *map(str.title, STUDENTS)} & set(page_text.replace(",", " ").split())


def test_a_batch_with_several_assignments_has_a_sheet_for_each(web: Web) -> None:
    requests = [grading_request("ada"), grading_request("bob", assignment=find_assignment("first-program"))]
    batch = intake.accept_batch(web.store, "both", requests, (), course=COURSE, max_attempts=3)
    service, actor = service_on(web.store), machine()
    with pytest.raises(Invalid, match="several assignments; name one of them: echo-responder, first-program"):
        download_sheet(service, actor, 1, batch.id)
    sheet = download_sheet(service, actor, 1, batch.id, "first-program")
    assert sheet.name == "both-first-program-moderation.html"
    assert "No grades yet." in words(sheet.data.decode())
