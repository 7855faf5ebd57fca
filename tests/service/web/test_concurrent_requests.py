"""Simultaneous requests for the same thing: each succeeds or is refused, and none gets a server error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from httpx2 import Response
from sqlalchemy import func, select

import acting
from builders import PROGRAM, echo
from service.operations import privacy
from service.settings import Settings
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.tables.people import Enrolment, LtiKey
from service.store.tables.submissions import SubmissionRow
from web import Web, submit, web_in

_FILES = [("files", ("robot.py", PROGRAM)), ("files", ("responder.py", "def responder(msg):\n    return msg\n"))]
_PLATFORM = {
    "name": "Moodle",
    "issuer": "https://platform.example.org",
    "client_id": "c",
    "deployments": ["1"],
    "authorization_url": "https://platform.example.org/auth",
    "token_url": "https://platform.example.org/token",
    "keys_url": "https://platform.example.org/keys",
}


@pytest.fixture
def web(service_settings: Settings) -> Iterator[Web]:
    with web_in(service_settings.home, database_url=service_settings.database_url) as made:
        yield made


def _at_once(web: Web, *requests: tuple[str, str, dict[str, Any]]) -> list[Response]:
    def ask(request: tuple[str, str, dict[str, Any]]) -> Response:
        method, path, options = request
        return web.browser(raise_server_exceptions=False).request(method, path, **options)

    with ThreadPoolExecutor(len(requests)) as pool:
        return list(pool.map(ask, requests))


def _opened(web: Web) -> None:
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.open_for_students(session, 1, echo().id)


def _first_policies(web: Web) -> list[Response]:
    headers = web.token(web.instructor(), "manage")
    request_options = {"json": {"assignment": "", "attempts": 1}, "headers": headers}
    return _at_once(web, *[("PUT", "/api/v1/courses/1/policies", request_options)] * 6)


def _first_extensions(web: Web) -> list[Response]:
    headers, ada = web.token(web.instructor(), "manage"), web.student()
    path = f"/api/v1/courses/1/people/{ada.enrolment_id}/extensions"
    return _at_once(web, *[("POST", path, {"json": {"more_attempts": 1}, "headers": headers})] * 6)


def _registrations(web: Web) -> list[Response]:
    headers = web.token(web.operator(), "manage")
    return _at_once(web, *[("POST", "/api/v1/operator/platforms", {"json": _PLATFORM, "headers": headers})] * 4)


def _opposite_joins(web: Web) -> list[Response]:
    headers = web.token(web.operator(), "manage")
    ids = [web.instructor(name, f"course of {name}").enrolment_id for name in ("grace", "hopper")]
    pairs = (ids, ids[::-1])
    paths = [(f"/api/v1/operator/people/{one}/join", {"json": {"other": other}}) for one, other in pairs]
    return _at_once(web, *[("POST", path, {**each, "headers": headers}) for path, each in paths])


def _removals(web: Web) -> list[Response]:
    headers, ada = web.token(web.instructor(), "manage", "sign-in", "mark"), web.student()
    path = f"/api/v1/courses/1/people/{ada.enrolment_id}"
    extend = ("POST", f"{path}/extensions", {"json": {"more_attempts": 1}, "headers": headers})
    link = ("POST", f"{path}/link", {"headers": headers})
    return _at_once(web, *[("DELETE", path, {"headers": headers})] * 3, extend, link)


def _removal_while_submitting(web: Web) -> list[Response]:
    headers, ada = web.token(web.instructor(), "manage"), web.student()
    _opened(web)
    own, path = web.token(ada, "submit"), f"/api/v1/courses/1/mine/submissions?assignment={echo().id}"
    sent = ("POST", path, {"files": _FILES, "headers": own})
    removal = ("DELETE", f"/api/v1/courses/1/people/{ada.enrolment_id}", {"headers": headers})
    return _at_once(web, removal, sent, sent)


@pytest.mark.parametrize(
    "ask",
    [_first_policies, _first_extensions, _registrations, _opposite_joins, _removals, _removal_while_submitting],
)
def test_what_is_asked_for_at_once_is_done_or_refused(web: Web, ask: Callable[[Web], list[Response]]) -> None:
    answers = ask(web)
    assert max(each.status_code for each in answers) < 500, [each.text for each in answers]
    assert min(each.status_code for each in answers) < 300, [each.text for each in answers]


def test_the_first_who_read_our_keys_make_one(web: Web) -> None:
    answers = _at_once(web, *[("GET", "/lti/keys", {})] * 5)
    assert len({answer.text for answer in answers}) == 1
    with web.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(LtiKey)) == 1


def test_a_student_who_is_removed_while_they_submit_stays_removed(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    ada, accept = web.student("ada"), intake.accept_submission
    _opened(web)
    browser = web.browser(ada)

    def accept_too_late(*arguments: Any, **options: Any) -> intake.AcceptedSubmission:
        privacy.erase_student(web.app.state.context.service, acting.machine(), 1, ada.enrolment_id)
        # SQLite reuses the ids of the previous one.
        web.student("bob")
        return accept(*arguments, **options)

    monkeypatch.setattr(intake, "accept_submission", accept_too_late)
    answer = submit(browser, f"/courses/1/mine/{echo().id}", files=_FILES)
    assert answer.status_code in (404, 422)
    with web.store.reading() as session:
        assert session.scalars(select(Enrolment.student)).all() == ["bob"]
        assert session.scalar(select(func.count()).select_from(SubmissionRow)) == 0
