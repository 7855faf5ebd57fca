"""Students' web submissions to an open assignment form one batch: its table, its end, and actions on it."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal

import pytest
from starlette.testclient import TestClient

import acting
import report_builders
from builders import PROGRAM, echo
from service.store import purge
from service.store import webhook_events as told_outbox
from service.store.batches import batches, job_lines, publishing
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.engine import now
from service.store.people import webhooks
from service.store.people.membership import Member
from service.store.states import JobState
from service.store.tables.submissions import Batch, Job
from sim.errors import UsageError
from web import Web, grade_all, submit

RESPONDER = "def responder(msg):\n    return msg\n"


@pytest.fixture
def grace(web: Web) -> TestClient:
    client = web.browser(web.instructor())
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
    submit(client, "/courses/1/assignments/echo-responder/open")
    return client


def batch_of(web: Web) -> str:
    with web.store.reading() as session:
        course_assignment = open_assignments.load_course_assignment(session, 1, "echo-responder").batch_id
    assert course_assignment is not None
    return course_assignment


def send(web: Web, member: Member, program: str = PROGRAM) -> None:
    answer = submit(web.browser(member), "/courses/1/mine/echo-responder", {"texts": [program, RESPONDER]})
    assert answer.status_code == 303, answer.text


def grade_with(web: Web, marks: int = 1) -> None:
    grade = report_builders.faulty_grade()
    first = replace(grade.criteria[0], marks=Decimal(marks), max_marks=Decimal(4))
    grade_all(web, replace(grade, criteria=(first,)))


def rows(page: str) -> list[str]:
    return re.findall(r'<th scope="row"><a [^>]*>([^<]*)', page[page.find("<tbody") :])


@pytest.mark.long
def test_each_student_is_in_the_table_once_with_the_attempt_that_counts(web: Web, grace: TestClient) -> None:
    ada, bob = web.student("ada"), web.student("bob")
    web.student("cyd")
    for marks, program in enumerate(("print(1)\n", "print(2)\n", "print(3)\n")):
        send(web, ada, program)
        grade_with(web, marks)
    send(web, bob)
    grade_with(web, 4)
    path = f"/courses/1/batches/{batch_of(web)}"
    page = grace.get(path).text
    assert rows(page) == ["ada", "bob"]
    assert "attempt 3" in page
    assert "Submitted on the web" in grace.get("/courses/1/batches").text
    assert path in grace.get("/courses/1/assignments/echo-responder").text
    overview = grace.get(f"{path}/overview").text
    assert "<dt>Graded</dt><dd>2</dd>" in overview
    assert "Cyd" in overview
    grade = re.findall(r'href="(/courses/1/grades/\w+)">ada', page)[0]
    assert grace.get(grade).text.count("Attempt ") == 3
    exported = grace.get(f"{path}/export?format=csv").text
    assert len(exported.strip().splitlines()) == 3
    with web.store.reading() as session:
        line = batches.load_batch(session, batch_of(web))
    assert (line.web_assignment, line.takes_in, line.jobs) == ("echo-responder", True, 2)


def test_what_is_over_a_limit_counts_where_there_is_nothing_else(web: Web, grace: TestClient) -> None:
    ada, bob = web.student("ada"), web.student("bob")
    send(web, ada, "print(1)\n")
    grade_with(web)
    with web.store.transaction() as session:
        policies.set_policy(session, 1, "", PolicyLimits(attempts=1))
    send(web, ada, "print(2)\n")
    with web.store.transaction() as session:
        policies.set_policy(session, 1, "", PolicyLimits(due_at=datetime(2020, 1, 1, tzinfo=UTC)))
    send(web, bob)
    grade_with(web)
    with web.store.reading() as session:
        states = {
            line.student: (line.attempt, line.staff_only) for line in job_lines.load_job_lines(session, batch_of(web))
        }
    assert states["ada"] == (1, None)
    assert states["bob"][1] is not None


def test_nobody_has_submitted_yet(web: Web, grace: TestClient) -> None:
    web.student("ada")
    overview = grace.get(f"/courses/1/batches/{batch_of(web)}/overview").text
    assert "No grades yet." in overview
    assert "Ada" in overview


def test_it_is_not_held_back_and_what_could_not_be_graded_is_retried(web: Web, grace: TestClient) -> None:
    send(web, web.student())
    batch = batch_of(web)
    page = grace.get(f"/courses/1/batches/{batch}").text
    assert "/pause" not in page
    assert "/cancel" not in page
    for done in (acting.pause, acting.cancel):
        with pytest.raises(UsageError, match="close echo-responder"):
            done(web.store, batch)
    with web.store.transaction() as session:
        job = session.query(Job).one()
        job.state, job.error = JobState.DEAD, "the worker ended"
    submit(grace, f"/courses/1/batches/{batch}/retry")
    grade_with(web)
    with web.store.reading() as session:
        assert session.query(Job).one().state is JobState.DONE


def test_it_is_finished_when_the_assignment_is_closed(web: Web, grace: TestClient) -> None:
    with web.store.transaction() as session:
        webhooks.create_webhook(session, 1, "https://hooks.example.org/x", ["batch.finished"])
    send(web, web.student())
    grade_with(web)
    assert told_outbox.claim_deliveries(web.store, 9) == []
    submit(grace, "/courses/1/assignments/echo-responder/close")
    (deliveries,) = told_outbox.claim_deliveries(web.store, 9)
    assert deliveries.payload["data"] == {"batch": batch_of(web), "states": {"done": 1}}
    with web.store.reading() as session:
        assert not batches.load_batch(session, batch_of(web)).takes_in


def test_a_regrade_is_of_the_attempts_that_count_and_publishing_of_all(web: Web, grace: TestClient) -> None:
    ada = web.student()
    for program in ("print(1)\n", "print(2)\n"):
        send(web, ada, program)
        grade_with(web)
    batch = batch_of(web)
    made = acting.regrade(web.store, batch, None, max_attempts=1, actor="grace")
    assert made.jobs == 1
    send(web, ada, "print(3)\n")
    grade_with(web, 2)
    page = grace.get(f"/courses/1/batches/{batch}/publish").text
    assert "This releases 3 grades to their students" in page
    assert "They belong to 1 student." in page
    with web.store.reading() as session:
        planned = publishing.preview_publication(session, batch).counts
        assert all(job.published_at is None for job in session.query(Job))
    assert (planned.published, planned.replaced) == (3, 1)
    assert acting.publish(web.store, batch, actor="grace") == planned
    assert "No grades to release." in grace.get(f"/courses/1/batches/{batch}/publish").text


def test_it_outlives_what_was_in_it_and_is_called_as_the_assignment(web: Web, grace: TestClient) -> None:
    send(web, web.student())
    grade_with(web)
    batch = batch_of(web)
    with web.store.reading() as session:
        later = now(session)
    assert purge.purge_submissions(web.store, later, "root").submissions == 1
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(replace(echo(), title="Echo again")))
        assert session.get_one(Batch, batch).name == "Submitted on the web: Echo again"
    send(web, web.student("bob"))
    with web.store.reading() as session:
        assert [line.student for line in job_lines.load_job_lines(session, batch)] == ["bob"]
