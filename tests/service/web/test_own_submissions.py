"""A student's pages: open assignments, their tasks, submitting, waiting, and the feedback."""

from __future__ import annotations

import re
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
from builders import PROGRAM, echo, grading_request, prepared
from service.store.batches import intake
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.people.membership import Member
from service.store.queue import jobs, workers
from service.store.queue.workers import WorkerDescription
from service.store.states import JobState
from service.store.tables.submissions import Job
from submissions.assignment.definition import Assignment
from web import COURSE, Web, submit, web_in, words

RESPONDER = "def responder(msg):\n    return msg\n"
MINE = "/courses/1/mine"
HOSTILE = "</textarea><script>alert(1)</script>"


def _assignment(name: str) -> Assignment:
    """Return the echo assignment with a criterion and a scenario hidden from students, and a given file."""
    assignment = echo()
    hidden = assignment.criteria[0].model_copy(
        update={"id": "hidden", "title": "Secret criterion", "marks": Decimal(7), "visibility": "hidden"}
    )
    secret = replace(assignment.scenarios[0], id="secret-scenario", visibility="hidden")
    return replace(
        assignment,
        id=name,
        title=f"About {name}",
        criteria=(*assignment.criteria, hidden),
        scenarios=(*assignment.scenarios, secret),
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
                open_assignments.prepare_assignment(session, 1, freeze_assignment(_assignment(name)))
            for name in ("open", "closed"):
                open_assignments.open_for_students(session, 1, name)
            open_assignments.close_assignment(session, 1, "closed")
        yield made


@pytest.fixture
def ada(web: Web, request: pytest.FixtureRequest) -> Member:
    """Return a new student without any data."""
    return web.student(request.node.name[:80])


def _send(browser: TestClient, program: str = PROGRAM, path: str = f"{MINE}/open") -> Response:
    return submit(browser, path, {"texts": [program, RESPONDER]})


def _grade(web: Web, marks: str = "1") -> None:
    grade = report_builders.faulty_grade()
    first = replace(grade.criteria[0], marks=Decimal(marks), max_marks=Decimal(4))
    after = replace(first, id="after", title="Secret criterion", visibility="after_published")
    grade = replace(grade, criteria=(first, after))
    while claim := jobs.claim_job(web.store, "worker", 60):
        jobs.finish_job(web.store, claim, prepared(grade), datetime.now(UTC))


def test_only_what_was_opened_or_was_submitted_to_is_listed(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    page_text = browser.get(MINE).text
    assert "About open" in page_text
    assert "About closed" in page_text
    assert "About prepared" not in page_text
    for name in ("prepared", "no-such", "submissions"):
        assert browser.get(f"{MINE}/{name}").status_code == 404
        assert _send(browser, path=f"{MINE}/{name}").status_code == 404
    assert browser.get(f"{MINE}/closed").status_code == 200
    refused = _send(browser, path=f"{MINE}/closed")
    assert (refused.status_code, "is closed; you can no longer submit to it" in refused.text) == (422, True)


def test_the_list_has_closed_assignments_and_those_of_batches_with_their_grades(web: Web, ada: Member) -> None:
    for name in ("closed", "of a batch"):
        request = grading_request(ada.id, assignment=_assignment(name))
        intake.accept_batch(web.store, name, [request], (), course=COURSE, max_attempts=3)
    _grade(web)
    answer = web.browser(ada).get(MINE)
    assert answer.status_code == 200
    listed = words(answer.text)
    assert listed.count("Current grade:") == 2
    assert "About closed Closed on" in listed
    assert listed.count("Closed on") == 1


def test_a_task_tells_nothing_that_is_hidden_and_gives_what_is_given(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    page_text = browser.get(f"{MINE}/open").text
    assert "The responder echoes each message" in page_text
    assert "Marks for hidden criteria: 7" in page_text
    for secret in ("Secret criterion", "secret-scenario", "do not tell", "key.py"):
        assert secret not in page_text
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
        assert "35 hours left" in browser.get(MINE).text
        with web.store.transaction() as session:
            policies.extend_policy(session, ada.enrolment_id, "open", due + timedelta(days=7), 3)
        assert "4 of 5 attempts left" in browser.get(f"{MINE}/open").text
        assert "8 days left" in browser.get(f"{MINE}/open").text
    finally:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits())


@pytest.mark.long
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
    german = browser.get(answer.headers["location"], headers={"accept-language": "de"}).text
    assert "<h2>Wiedergabe</h2>" in german
    assert "Errors" not in german


@pytest.mark.parametrize("path", [f"{MINE}/open", f"{MINE}/open/try"])
def test_a_refusal_keeps_what_was_typed_as_it_was(web: Web, ada: Member, path: str) -> None:
    browser = web.browser(ada)
    typed = f"\n\tprint('\u202e')  # {HOSTILE}"
    answer = submit(browser, path, {"texts": [typed, ""]}, files=[("files", ("robot.py", b"x = 1"))])
    assert answer.status_code == 422
    assert "<script>alert" not in answer.text
    assert "\n\n\tprint(&#39;\u202e&#39;)  # &lt;/textarea&gt;&lt;script&gt;" in answer.text
    assert 'role="alert"' in answer.text
    assert "robot.py was both selected as a file and typed" in answer.text
    empty = submit(browser, path)
    assert "No files were submitted; select a file, or paste a program." in empty.text


@pytest.mark.long
@pytest.mark.parametrize(
    ("files", "texts", "german"),
    [
        ([], [], "Es wurden keine Dateien abgegeben; wählen Sie eine Datei aus oder fügen Sie ein Programm ein."),
        ([("essay.pdf", b"%PDF")], [], "enthält weder robot.py noch responder.py (gefunden: essay.pdf)"),
        ([("robot.py", b"x" * (17 << 20))], [], "ist zu groß, erlaubt sind höchstens 16 MB je Datei"),
        (
            [("robot.py", b" \n"), ("responder.py", RESPONDER.encode())],
            [],
            "robot.py ist leer, erwartet wird ein Programm.",
        ),
        ([("robot.py", b"\x00"), ("responder.py", RESPONDER.encode())], [], "hat ein NUL-Zeichen in Zeile 1"),
        ([("all.zip", b"PK\x03\x04 torn")], [], "ist kein lesbares ZIP-Archiv"),
        ([("robot.py", PROGRAM.encode())], [PROGRAM], "robot.py wurde sowohl als Datei ausgewählt als auch eingegeben"),
        ([("robot.py", PROGRAM.encode())], [], "responder.py fehlt; fügen Sie die Datei hinzu"),
    ],
)
def test_a_german_page_refuses_in_german(
    web: Web, ada: Member, files: list[tuple[str, bytes]], texts: list[str], german: str
) -> None:
    browser = web.browser(ada)
    sent = [("files", file) for file in files]
    answer = submit(browser, f"{MINE}/open", {"texts": texts}, files=sent or None, headers={"accept-language": "de"})
    assert answer.status_code == 422
    (page_text,) = re.findall(r'<p class="refused" role="alert">(.*?)</p>', answer.text, re.DOTALL)
    assert german in page_text
    assert "expected" not in page_text


def test_a_part_that_is_missing_is_asked_for_once(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    answer = submit(browser, f"{MINE}/open", {"texts": [PROGRAM, ""]})
    assert answer.status_code == 422
    assert "There is no responder.py; add it" in answer.text
    assert 'name="even_in_part"' in answer.text
    assert 'name="even_in_part"' not in browser.get(f"{MINE}/open").text
    again = submit(browser, f"{MINE}/open", {"texts": [PROGRAM, ""], "even_in_part": "true"})
    assert again.status_code == 303


@pytest.mark.long
def test_too_many_are_told_when_to_come_again(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    answers = [submit(browser, f"{MINE}/open") for _ in range(11)]
    assert [answer.status_code for answer in answers] == [422] * 10 + [429]
    assert int(answers[-1].headers["retry-after"]) > 0
    assert "Try again in" in answers[-1].text


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
        policies.extend_policy(session, ada.enrolment_id, "open", None, 0)
        policies.set_policy(session, 1, "open", PolicyLimits(attempts=1))
    try:
        over = _send(browser, "print(2)").headers["location"]
        _grade(web, "4")
        page_text = browser.get(over).text
    finally:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits())
    assert "no attempts left" in page_text
    assert "Your current grade is still from attempt 1." in page_text
    assert "4 of 4 marks" not in page_text
    assert "division by zero" not in page_text
    card = browser.get(MINE).text
    assert "4 of 4 marks" not in card
    assert re.search(r"<b>Current grade:</b> <a [^>]*>Attempt 1</a>: 2 of 8 marks", card)
    assert "not marked: no attempts left" in card


def test_attempts_are_shown_with_how_the_marks_moved(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    for marks in ("1", "3"):
        last = _send(browser, f"print({marks})").headers["location"]
        _grade(web, marks)
    page_text = browser.get(last).text
    assert '<polyline points="4.0,16.0 96.0,8.0 "/>' in page_text
    assert "1 of 4 marks" in page_text
    assert "3 of 4 marks" in page_text
    newer = _send(browser, "print(5)").headers["location"]
    _send(browser, "print(6)")
    assert "Replaced by a newer submission." in browser.get(newer).text
    _grade(web)


def test_the_attempt_that_counts_and_the_same_files_are_marked(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    for program, marks in (("print('high')", "3"), ("print('low')", "1"), ("print('high')", "3")):
        last = _send(browser, program).headers["location"]
        _grade(web, marks)
    page_text = browser.get(last).text
    assert "same files as attempt 1; no attempt used" in page_text
    rows = re.findall(r"<tr><th scope=\"row\">.*?</tr>", page_text.partition("<h2>Your attempts</h2>")[2], re.DOTALL)
    assert ["current grade</span>" in row for row in rows] == [True, False, False]


def test_a_limit_that_is_reached_is_named_and_invites_no_more(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    due = datetime.now(UTC) - timedelta(hours=9.5)
    try:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits(due, late_days=1, attempts=1))
        late = _send(browser, "print('late')").headers["location"]
        _grade(web)
        page_text = browser.get(late).text
        assert "9 hours late" in page_text
        assert "Submit again" not in page_text
        page_text = browser.get(f"{MINE}/open").text
        assert "You have used all your attempts" in page_text
        assert '<button class="second">Submit</button>' in page_text
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits(due - timedelta(days=2), attempts=1))
        first = web.browser(web.student("comes too late"))
        assert "The last date for submissions has passed" in first.get(f"{MINE}/open").text
        over = _send(first, "print('too late')").headers["location"]
        _grade(web)
        page_text = first.get(over).text
        assert "submitted after the last date" in page_text
        assert "is still from attempt" not in page_text
    finally:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, "open", PolicyLimits())


def test_cards_come_by_due_date_then_title(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    with web.store.transaction() as session:
        for name in ("zebra", "soon", "apple"):
            open_assignments.prepare_assignment(session, 1, freeze_assignment(_assignment(name)))
            open_assignments.open_for_students(session, 1, name)
        for name, days in (("zebra", 9), ("soon", 2), ("apple", 9)):
            policies.set_policy(session, 1, name, PolicyLimits(datetime(2100, 1, days, tzinfo=UTC)))
    try:
        assert re.findall(r">About (\w+)</a>", browser.get(MINE).text) == ["soon", "apple", "zebra", "open", "closed"]
    finally:
        with web.store.transaction() as session:
            for name in ("zebra", "soon", "apple"):
                open_assignments.close_assignment(session, 1, name)


def test_what_failed_by_our_fault_says_so_and_tells_no_more(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    mine = _send(browser).headers["location"]
    with web.store.transaction() as session:
        dead = {"state": JobState.DEAD, "error": "the worker secret-host fell silent"}
        session.execute(update(Job).where(Job.enrolment_id == ada.enrolment_id).values(**dead))
    page_text = browser.get(mine).text
    assert "Failed; this is not your fault." in page_text
    assert "secret-host" not in page_text


def test_the_place_in_the_queue_and_the_time_left_are_told(web: Web, ada: Member) -> None:
    first, second = web.browser(ada), web.browser(web.student("somebody else"))
    mine = _send(first, "print('a')").headers["location"]
    theirs = _send(second, "print('b')").headers["location"]
    assert "The grading service is not running." in first.get(mine).text
    workers.record_heartbeat(web.store, WorkerDescription("worker", "here", 1, "1", "all"))
    assert "Your submission is next in the queue." in first.get(mine).text
    assert "1 submission is ahead of yours in the queue." in second.get(theirs).text
    assert first.get(theirs).status_code == 404
    assert first.get(f"{MINE}/submissions/{10**30}").status_code in (404, 422)
    claim = jobs.claim_job(web.store, "worker", 60)
    assert claim is not None
    jobs.renew_lease(web.store, claim, 60, 0.5)
    assert "This submission is being graded." in first.get(mine).text
    jobs.finish_job(web.store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    _grade(web)


def test_students_see_whether_the_latest_or_the_best_attempt_counts(web: Web, ada: Member) -> None:
    browser, staff = web.browser(ada), web.browser(web.instructor())
    _send(browser)
    _grade(web)
    latest = browser.get(f"{MINE}/open").text
    assert "Your latest graded attempt" in latest
    assert ">current grade<" in latest
    try:
        answer = submit(staff, "/courses/1/policy/counted-attempt", {"counted_attempt": "best"})
        assert answer.headers["location"] == "/courses/1/assignments?done=counted-attempt"
        assert '<option value="best" selected>' in staff.get(answer.headers["location"]).text
        # The attempt has a hidden criterion, which must not become comparable.
        best = browser.get(f"{MINE}/open").text
        assert "Your best graded attempt" in best
        assert "It is marked when you can see all marks" in best
        assert ">current grade<" not in best
    finally:
        submit(staff, "/courses/1/policy/counted-attempt", {"counted_attempt": "latest"})
