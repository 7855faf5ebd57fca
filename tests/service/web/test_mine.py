"""A student's pages: what is open, what may be read of it, submitting, waiting, and what is shown afterwards."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from io import BytesIO

import pytest
from httpx2 import Response
from sqlalchemy import update
from starlette.testclient import TestClient

import report_builders
from builders import PROGRAM, echo
from service.store import jobs, open_assignments, policies, results, workers
from service.store.models import Job
from service.store.people import Member
from service.store.policies import PolicyLimits
from service.store.states import JobState
from service.store.versions import freeze
from service.store.workers import WorkerDescription
from submissions.assignment.definition import Assignment
from web import Web, submit, web_in

RESPONDER = "def responder(msg):\n    return msg\n"
MINE = "/courses/1/mine"
HOSTILE = "</textarea><script>alert(1)</script>"


def _assignment(name: str) -> Assignment:
    """The echo assignment with a criterion and a scenario that students do not see, and a file that they get."""
    asked = echo()
    hidden = asked.criteria[0].model_copy(
        update={"id": "hidden", "title": "Secret criterion", "marks": Decimal(7), "visibility": "hidden"}
    )
    secret = replace(asked.scenarios[0], id="secret-scenario", visibility="hidden")
    return replace(
        asked,
        id=name,
        title=f"About {name}",
        criteria=(*asked.criteria, hidden),
        scenarios=(*asked.scenarios, secret),
        given={"notes.txt": b"counts from 0"},
        given_parts={"key.py": "answer = 42"},
        secret="do not tell",
    )


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    with web_in(tmp_path_factory.mktemp("home")) as made:
        made.instructor()
        with made.store.transaction() as session:
            for name in ("open", "prepared", "closed"):
                open_assignments.prepare(session, 1, freeze(_assignment(name)))
            for name in ("open", "closed"):
                open_assignments.open_for_students(session, 1, name)
            open_assignments.close(session, 1, "closed")
        yield made


@pytest.fixture
def ada(web: Web, request: pytest.FixtureRequest) -> Member:
    """A student of whom nothing is there yet."""
    return web.student(request.node.name[:80])


def _send(browser: TestClient, program: str = PROGRAM, path: str = f"{MINE}/open") -> Response:
    return submit(browser, path, {"texts": [program, RESPONDER]})


def _grade(web: Web, marks: str = "1") -> None:
    grade = report_builders.faulty_grade()
    first = replace(grade.criteria[0], marks=Decimal(marks), max_marks=Decimal(4))
    after = replace(first, id="after", title="Secret criterion", visibility="after_published")
    grade = replace(grade, criteria=(first, after))
    while claim := jobs.claim(web.store, "worker", 60):
        jobs.finish(web.store, claim, results.prepare(grade), datetime.now(UTC))


def test_only_what_is_open_or_was_submitted_to_is_listed(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    shown = browser.get(MINE).text
    assert "About open" in shown
    assert "About prepared" not in shown
    assert "About closed" not in shown
    for name in ("prepared", "closed", "no-such", "submissions"):
        assert browser.get(f"{MINE}/{name}").status_code == 404
        assert _send(browser, path=f"{MINE}/{name}").status_code == 404


def test_a_task_tells_nothing_that_is_hidden_and_gives_what_is_given(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    shown = browser.get(f"{MINE}/open").text
    assert "The responder echoes each message" in shown
    assert "7 more marks are for checks that are not shown here." in shown
    for secret in ("Secret criterion", "secret-scenario", "do not tell", "key.py"):
        assert secret not in shown
    given = browser.get(f"{MINE}/open/given/notes.txt")
    assert (given.content, given.headers["content-type"]) == (b"counts from 0", "application/octet-stream")
    assert given.headers["content-disposition"].startswith('attachment; filename="notes.txt"')
    for name in ("key.py", "assignment.toml", "..%2Fnotes.txt"):
        assert browser.get(f"{MINE}/open/given/{name}").status_code == 404


def test_a_limit_and_an_extension_are_told_as_they_count(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    due = datetime.now(UTC) + timedelta(days=1.5)
    with web.store.transaction() as session:
        policies.set_policy(session, 1, "open", PolicyLimits(due, attempts=2))
    try:
        assert "2 of 2 attempts left" in browser.get(MINE).text
        _send(browser)
        _grade(web)
        assert "1 of 2 attempts left" in browser.get(MINE).text
        assert "2 days left" in browser.get(MINE).text
        with web.store.transaction() as session:
            policies.extend(session, ada.enrolment_id, "open", due + timedelta(days=7), 3)
        assert "4 of 5 attempts left" in browser.get(f"{MINE}/open").text
        assert "9 days left" in browser.get(f"{MINE}/open").text
    finally:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits())


def test_files_go_where_they_are_waited_for_and_come_back_as_they_were(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    files = [("files", ("robot.py", PROGRAM.encode())), ("files", ("responder.py", RESPONDER.encode()))]
    answer = submit(browser, f"{MINE}/open", files=files)
    assert answer.status_code == 303
    waiting = browser.get(answer.headers["location"])
    assert 'hx-trigger="every 2s"' in waiting.text
    assert '<noscript><meta http-equiv="refresh"' in waiting.text
    kept = zipfile.ZipFile(BytesIO(browser.get(f"{answer.headers['location']}/files").content))
    assert kept.read("robot.py").decode() == PROGRAM
    assert browser.get(answer.headers["location"], headers={"hx-request": "true"}).text.startswith('<div id="progress"')
    _grade(web)
    over = browser.get(answer.headers["location"], headers={"hx-request": "true"})
    assert over.headers["hx-refresh"] == "true"
    assert "division by zero" in browser.get(answer.headers["location"]).text


@pytest.mark.parametrize("path", [f"{MINE}/open", f"{MINE}/open/try"])
def test_a_refusal_keeps_what_was_typed_as_it_was(web: Web, ada: Member, path: str) -> None:
    browser = web.browser(ada)
    typed = f"\n\tprint('\u202e')  # {HOSTILE}"
    answer = submit(browser, path, {"texts": [typed, ""]}, files=[("files", ("robot.py", b"x = 1"))])
    assert answer.status_code == 422
    assert "<script>alert" not in answer.text
    assert "\n\n\tprint(&#39;\u202e&#39;)  # &lt;/textarea&gt;&lt;script&gt;" in answer.text
    assert 'role="alert"' in answer.text
    empty = submit(browser, path)
    assert "Nothing was sent; choose a file, or paste a program." in empty.text


def test_too_many_are_told_when_to_come_again(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    answers = [submit(browser, f"{MINE}/open") for _ in range(11)]
    assert [answer.status_code for answer in answers] == [422] * 10 + [429]
    assert int(answers[-1].headers["retry-after"]) > 0
    assert "come again in" in answers[-1].text


def test_no_marks_are_shown_that_are_not_published_and_none_that_are_for_staff(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    first = _send(browser, "print(1)").headers["location"]
    _grade(web, "1")
    assert "1 of 4 marks" in browser.get(MINE).text
    assert "Secret criterion" not in browser.get(first).text
    with web.store.transaction() as session:
        session.execute(update(Job).where(Job.enrolment_id == ada.enrolment_id).values(published_at=datetime.now(UTC)))
    assert "2 of 8 marks" in browser.get(MINE).text
    assert "Secret criterion" in browser.get(first).text
    with web.store.transaction() as session:
        policies.extend(session, ada.enrolment_id, "open", None, 0)
        policies.set_policy(session, 1, "open", PolicyLimits(attempts=1))
    try:
        over = _send(browser, "print(2)").headers["location"]
        _grade(web, "4")
        shown = browser.get(over).text
    finally:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits())
    assert "attempt 2, allowed: 1" in shown
    assert "4 of 4 marks" not in shown
    assert "division by zero" not in shown
    assert "4 of 4 marks" not in browser.get(MINE).text


def test_attempts_are_shown_with_how_the_marks_moved(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    for marks in ("1", "3"):
        last = _send(browser, f"print({marks})").headers["location"]
        _grade(web, marks)
    shown = browser.get(last).text
    assert '<polyline points="4.0,16.0 96.0,8.0 "/>' in shown
    assert "1 of 4 marks" in shown
    assert "3 of 4 marks" in shown
    newer = _send(browser, "print(5)").headers["location"]
    _send(browser, "print(6)")
    assert "A newer one took its place." in browser.get(newer).text
    _grade(web)


def test_what_failed_by_our_fault_says_so_and_tells_no_more(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    mine = _send(browser).headers["location"]
    with web.store.transaction() as session:
        dead = {"state": JobState.DEAD, "error": "the worker secret-host fell silent"}
        session.execute(update(Job).where(Job.enrolment_id == ada.enrolment_id).values(**dead))
    shown = browser.get(mine).text
    assert "Could not be graded, through no fault of yours." in shown
    assert "secret-host" not in shown


def test_the_place_in_the_queue_and_the_time_left_are_told(web: Web, ada: Member) -> None:
    first, second = web.browser(ada), web.browser(web.student("somebody else"))
    mine = _send(first, "print('a')").headers["location"]
    theirs = _send(second, "print('b')").headers["location"]
    assert "nothing grades at the moment" in first.get(mine).text
    workers.beat(web.store, WorkerDescription("worker", "here", 1, "1", "all"))
    assert "It is the next to be graded." in first.get(mine).text
    assert "One is graded before it." in second.get(theirs).text
    assert first.get(theirs).status_code == 404
    assert first.get(f"{MINE}/submissions/{10**30}").status_code in (404, 422)
    claim = jobs.claim(web.store, "worker", 60)
    assert claim is not None
    jobs.heartbeat(web.store, claim, 60, 0.5)
    assert '<progress value="0.5"' in first.get(mine).text
    jobs.finish(web.store, claim, results.prepare(report_builders.faulty_grade()), datetime.now(UTC))
    _grade(web)
