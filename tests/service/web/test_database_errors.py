"""Database errors: reported with their effect, and never as "nothing was changed" after a change."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.exc import IntegrityError, MultipleResultsFound, NoResultFound, OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.orm.exc import StaleDataError
from structlog.testing import capture_logs

from builders import PROGRAM, echo
from service.operations import replies
from service.queue import notifier
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.tables.submissions import SubmissionRow
from web import Web, submit


class _Failure(Exception):
    def __init__(self, sqlstate: str) -> None:
        super().__init__(sqlstate)
        self.sqlstate = sqlstate


def _raise(error: Exception) -> Callable[..., Any]:
    def fail(*_: object, **__: object) -> Any:
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "status", "sentence"),
    [
        (OperationalError("SELECT 1", {}, OSError("refused")), 503, "The database does not respond."),
        (PoolTimeoutError("all connections are used"), 503, "The database does not respond."),
        (OperationalError("UPDATE job", {}, _Failure("40P01")), 409, "Another user changed this"),
        (IntegrityError("INSERT", {}, _Failure("23505")), 409, "Another user changed this"),
        (IntegrityError("DELETE", {}, _Failure("23503")), 409, "Another user changed this"),
        (IntegrityError("INSERT", {}, _Failure("23502")), 500, "The server could not process this request"),
        (OperationalError("INSERT", {}, _Failure("54000")), 500, "The server could not process this request"),
        (NoResultFound("no row"), 409, "Another user changed this"),
        (StaleDataError("0 rows matched"), 409, "Another user changed this"),
        (MultipleResultsFound("several rows"), 500, "The server could not process this request"),
        (IntegrityError("INSERT", {}, ValueError("not unique")), 500, "The server could not process this request"),
    ],
)
def test_what_is_wrong_with_the_database_is_told_as_what_it_is(
    web: Web, error: SQLAlchemyError, status: int, sentence: str
) -> None:
    def fail() -> None:
        raise error

    web.app.api_route("/broken", methods=["GET", "POST"])(fail)
    browser = web.browser(web.instructor(), raise_server_exceptions=False)
    for answer in (browser.get("/broken"), submit(browser, "/broken")):
        assert answer.status_code == status, answer.text
        assert sentence in answer.text
        assert "nothing was changed" not in answer.text


@pytest.mark.parametrize("error", [ValueError("surprise"), MultipleResultsFound("several rows")])
def test_the_trace_of_an_error_is_logged_once(web: Web, error: Exception) -> None:
    def fail() -> None:
        raise error

    web.app.get("/broken")(fail)
    browser, traces = web.browser(web.instructor()), 0
    with capture_logs() as logs:
        try:
            browser.get("/broken")
        except ValueError:
            # The server logs the exception.
            traces += 1
    traces += sum("exc_info" in each for each in logs)
    assert traces == 1
    assert [each["event"] for each in logs if each["log_level"] == "error"] == ["web.surprise"]


_AWAY = OperationalError("UPDATE job", {}, OSError("the server closed the connection"))


def test_a_submission_is_accepted_although_the_database_fails_after_it(
    web: Web, monkeypatch: pytest.MonkeyPatch
) -> None:
    ada = web.student("ada")
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.open_for_students(session, 1, echo().id)
    monkeypatch.setattr(notifier, "mark_notified", _raise(_AWAY))
    files = [("files", ("robot.py", PROGRAM)), ("files", ("responder.py", "def responder(msg):\n    return msg\n"))]
    answer = submit(web.browser(ada), f"/courses/1/mine/{echo().id}", files=files)
    assert answer.status_code == 303, answer.text
    with web.store.reading() as session:
        assert len(session.scalars(select(SubmissionRow.id)).all()) == 1


def test_an_answer_of_the_api_is_given_although_it_cannot_be_kept(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    headers = web.token(web.instructor(), "read", "manage") | {"idempotency-key": "once"}
    monkeypatch.setattr(replies, "store_reply", _raise(_AWAY))
    students = {"students": [{"id": "ada"}]}
    assert web.browser().post("/api/v1/courses/1/people", headers=headers, json=students).status_code == 201
    # A completed request is not repeated.
    assert web.browser().post("/api/v1/courses/1/people", headers=headers, json=students).status_code == 409
