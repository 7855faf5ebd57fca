"""The pages that run programs, without JavaScript and for htmx: test runs of an assignment, and the playground."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from html import unescape

import pytest
from httpx2 import Response
from sqlalchemy import select, update
from starlette.testclient import TestClient

from builders import PROGRAM, echo
from service.playground import STARTER_PROGRAM
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.people.membership import Member
from service.store.queue import test_runs
from service.store.states import RunState
from service.store.tables.submissions import Tryout
from submissions.assignment.folder import locate_assignment_folder
from web import Web, submit, web_in, words

TRY = "/courses/1/mine/echo-responder/try"
PLAYGROUND = "/courses/1/playground"
RESPONDER = "def responder(msg):\n    return msg\n"
PART = {"hx-request": "true"}
GERMAN = {"accept-language": "de"}
_RESULT = {
    "tone": "bad",
    "happened": "Your robot program stopped.",
    "whose": "",
    "seconds": 1.0,
    "lines": [[0.5, "<begun>"]],
    "more_lines": 0,
    "faults": [
        {"where": "Robot program, line 2", "file": "robot.py", "line": 2, "message": 'NameError: "x"', "hint": "Look."},
        {"where": "Robot program, line 1 of helper.py", "file": "helper.py", "line": 1, "message": "no", "hint": ""},
    ],
    "failed": "#trial=1&t=0.5",
    "notes": [],
}
_LINK = re.compile(r'<a href="#text1" data-file="robot.py" data-line="2" data-message="(.*?)">Robot program, line 2<')


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    with web_in(tmp_path_factory.mktemp("home")) as made:
        made.instructor()
        with made.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, echo().id)
        yield made


@pytest.fixture
def ada(web: Web, request: pytest.FixtureRequest) -> Member:
    """Return a new student without any data."""
    return web.student(request.node.name[:80])


def _finish(web: Web) -> None:
    """Give every waiting run the same result, without a worker."""
    while claim := test_runs.claim_test_run(web.store, 60):
        test_runs.finish_test_run(web.store, claim, _RESULT, zlib.compress(b"{}"))


def _texts(answer: Response) -> list[str]:
    """Return the texts in the editors of a page."""
    return [unescape(text) for text in re.findall(r"<textarea[^>]*>\n(.*?)</textarea>", answer.text, re.DOTALL)]


def _run(browser: TestClient, path: str, **options: object) -> Response:
    return submit(browser, path, {"texts": [PROGRAM, RESPONDER]}, **options)


@pytest.mark.parametrize("path", [TRY, PLAYGROUND])
def test_without_javascript_a_run_is_waited_for_and_its_program_stays(web: Web, ada: Member, path: str) -> None:
    browser = web.browser(ada)
    answer = _run(browser, path)
    assert (answer.status_code, answer.headers["location"]) == (303, path)
    waiting = browser.get(path)
    assert '<noscript><meta http-equiv="refresh"' in waiting.text
    assert "Your test run is next in the queue." in waiting.text
    _finish(web)
    ended = browser.get(path)
    assert _texts(ended) == [PROGRAM, RESPONDER]
    (message,) = _LINK.findall(ended.text)
    assert unescape(message) == 'NameError: "x" Look.'
    assert "<b>Robot program, line 1 of helper.py</b>: no" in ended.text
    assert "&lt;begun&gt;" in ended.text
    assert '<section class="replay"' in ended.text
    assert "<template" not in ended.text
    assert "refresh" not in ended.text


@pytest.mark.parametrize("path", [TRY, PLAYGROUND])
def test_htmx_asks_less_often_far_back_in_the_queue(web: Web, ada: Member, path: str) -> None:
    browser = web.browser(ada)
    assert browser.get(path, headers=PART).headers["hx-refresh"] == "true"
    begun = _run(browser, path, headers=PART)
    assert begun.text.startswith(f'<section id="result" hx-get="{path}" hx-trigger="every 250ms" hx-swap="outerHTML">')
    with web.store.transaction() as session:
        session.execute(update(Tryout).values(queued_at=datetime.now(UTC) - timedelta(minutes=1)))
    assert 'hx-trigger="every 1000ms"' in browser.get(path, headers=PART).text
    with web.store.transaction() as session:
        row = session.scalars(select(Tryout).where(Tryout.enrolment_id == ada.enrolment_id)).one()
        common = {"enrolment_id": row.enrolment_id, "assignment_version_id": row.assignment_version_id, "packed": b""}
        earlier = row.queued_at - timedelta(hours=2)
        session.add_all(Tryout(**common, state=RunState.QUEUED.value, queued_at=earlier) for _ in range(11))
    progress = browser.get(path, headers=PART).text
    assert 'hx-trigger="every 2200ms"' in progress
    assert "11 test runs are ahead of yours in the queue." in progress
    _finish(web)
    part = browser.get(path, headers=PART)
    assert part.text.startswith('<section id="result">\n')
    assert "hx-get" not in part.text
    assert _LINK.search(part.text)
    assert '<template class="replay"><section class="replay"' in part.text
    assert '<p id="run-status" hx-swap-oob="innerHTML">Your robot program stopped. Robot program, line 2' in part.text


@pytest.mark.parametrize("path", [TRY, PLAYGROUND])
def test_a_rejection_is_a_part_for_htmx_and_a_page_with_the_texts_without_it(web: Web, ada: Member, path: str) -> None:
    browser = web.browser(ada)
    _run(browser, path)
    part = _run(browser, path, headers=PART)
    assert (part.status_code, part.text.count("<section")) == (200, 1)
    assert 'role="alert">Your previous test run is not completed yet' in part.text
    typed = submit(browser, path, {"texts": ["print('mine')", ""]})
    assert typed.status_code == 422
    assert _texts(typed) == ["print('mine')", ""]
    assert "Select your files again." in typed.text
    _finish(web)
    # The editors have another program than the run, so its errors are no links.
    typed = submit(browser, path, {"texts": ["", ""]}, headers=GERMAN)
    assert "Es wurden keine Dateien abgegeben" in typed.text


def test_a_burst_is_rejected_with_the_time_to_wait(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    answers = [submit(browser, PLAYGROUND, {"texts": ["", ""]}) for _ in range(11)]
    assert [answer.status_code for answer in answers] == [422] * 10 + [429]
    assert int(answers[-1].headers["retry-after"]) > 0
    assert "Try again in" in submit(browser, PLAYGROUND, headers=PART).text


def test_one_can_start_from_the_starter_the_attempt_or_the_run(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    folder = locate_assignment_folder("echo-responder") / "starter"
    starter = [(folder / name).read_text() for name in ("robot.py", "responder.py")]
    first = browser.get(TRY)
    assert _texts(first) == starter
    assert "Start from:" not in first.text
    submit(browser, TRY.removesuffix("/try"), {"texts": ["print('attempt')", RESPONDER]})
    assert _texts(browser.get(TRY)) == ["print('attempt')", RESPONDER]
    _run(browser, TRY)
    _finish(web)
    latest = browser.get(TRY)
    assert _texts(latest) == [PROGRAM, RESPONDER]
    assert re.findall(r"\?from=([\w-]+)", latest.text) == ["starter", "attempt", "test-run"]
    assert _texts(browser.get(f"{TRY}?from=starter")) == starter
    attempt = browser.get(f"{TRY}?from=attempt")
    assert _texts(attempt) == ["print('attempt')", RESPONDER]
    # Its errors are those of another program.
    assert _LINK.search(latest.text)
    assert not _LINK.search(attempt.text)
    assert browser.get(f"{TRY}?from=other").status_code == 422


def test_the_page_names_the_limits_of_a_submission(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    try:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, echo().id, PolicyLimits(datetime.now(UTC) - timedelta(days=2)))
        assert "The last date for submissions has passed." in browser.get(TRY).text
    finally:
        with web.store.transaction() as session:
            policies.set_policy(session, 1, echo().id, PolicyLimits())
    _run(browser, TRY)
    _finish(web)
    submit(browser, TRY.removesuffix("/try"), {"texts": [PROGRAM, RESPONDER]})
    try:
        with web.store.transaction() as session:
            open_assignments.close_assignment(session, 1, echo().id)
        closed = browser.get(TRY)
        assert "This assignment was closed on" in closed.text
        assert (closed.status_code, "<textarea" in closed.text) == (200, False)
    finally:
        with web.store.transaction() as session:
            open_assignments.open_for_students(session, 1, echo().id)


def test_the_start_is_drawn_on_the_floor(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    pose = echo().scenarios[0].poses[0]
    page = browser.get(TRY).text
    assert '<image href="data:image/webp;base64,' in page
    assert f'<g transform="translate({pose.x} {1143 - pose.y}) rotate({-pose.heading})">' in page
    assert "Start auf Empty_Map: x " in browser.get(TRY, headers=GERMAN).text


def test_the_playground_moves_the_robot_to_the_start_of_another_floor(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    first = browser.get(PLAYGROUND)
    assert _texts(first) == [STARTER_PROGRAM, ""]
    query = {"floor": "Loop", "shown": "Empty_Map", "x": "7", "y": "7", "heading": "7", "light_noise": "9"}
    other = browser.get(PLAYGROUND, params=query, headers=PART).text
    assert other.startswith('<div class="beside" id="world"')
    for value in ('"500"', '"90"', '"9"', '"Loop"'):
        assert f"value={value}" in other
    same = browser.get(PLAYGROUND, params=query | {"shown": "Loop"}, headers=PART).text
    assert "translate(7.0 1136.0) rotate(-7.0)" in same
    assert "<option selected>Loop</option>" in browser.get(f"{PLAYGROUND}?floor=Loop").text
    for wrong in ({"floor": "Lop"}, {"floor": "Loop", "x": "5000"}, {"floor": "Loop", "x": "nan"}):
        assert browser.get(PLAYGROUND, params=wrong).status_code == 422
    assert browser.get(PLAYGROUND, params={"floor": "Loop", "x": "5000"}, headers=PART).status_code == 204


def test_the_playground_keeps_the_world_of_the_run(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    world = {"floor": "Loop", "x": "300", "y": "200", "heading": "45", "light_noise": "5", "motor_noise": "0"}
    answer = submit(browser, PLAYGROUND, {"texts": [PROGRAM, ""], **world})
    assert answer.status_code == 303
    assert "translate(300.0 943.0) rotate(-45.0)" in browser.get(PLAYGROUND).text
    rejected = submit(browser, PLAYGROUND, {"texts": [PROGRAM, ""], **world, "x": "400"})
    assert rejected.status_code == 422
    assert "translate(400.0 943.0)" in rejected.text
    _finish(web)


def test_staff_have_the_playground_too_and_german_texts(web: Web) -> None:
    page = web.browser(web.instructor()).get(PLAYGROUND, headers=GERMAN)
    assert page.status_code == 200
    read = words(page.text)
    for text in ("Spielwiese", "Boden und Start", "Rauschen der Motoren", "Ausführen"):
        assert text in read
    for text in ("Playground", "noise", "Heading"):
        assert text not in read
