"""A web application with a separate database, and browsers and programs that are signed in to it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from html import unescape
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from httpx2 import Response
from starlette.testclient import TestClient

from builders import opened, prepared, settings_in
from service.grading.grade import Grade
from service.operations import people as operations
from service.operations.context import Actor
from service.operations.people import JoinRequest
from service.queue.broker import build_broker_url
from service.settings import Settings
from service.store.engine import Store
from service.store.people import credentials, membership
from service.store.people.membership import Member
from service.store.people.reach import Reach
from service.store.queue import jobs
from service.store.states import CredentialKind
from service.web.app import make_app
from submissions.student_identity import Student

COURSE = "default"


@dataclass(frozen=True, slots=True)
class Web:
    """The application and its store."""

    settings: Settings
    store: Store
    app: FastAPI

    def browser(self, member: Member | None = None, **options: Any) -> TestClient:
        """Return a browser on this machine, signed in as ``member``, or not signed in."""
        client = TestClient(self.app, base_url="http://localhost", follow_redirects=False, **options)
        if member is not None:
            answer = client.post("/sign-in", data={"secret": self.link(member)})
            assert answer.status_code == 303, answer.text
        return client

    def link(self, member: Member) -> str:
        with self.store.transaction() as session:
            return credentials.issue_credential(session, member.person_id, CredentialKind.LINK, timedelta(hours=1))

    def token(self, member: Member, *scopes: str) -> dict[str, str]:
        """Return the authorization header of a program with this member's rights."""
        with self.store.transaction() as session:
            secret = credentials.issue_credential(
                session,
                member.person_id,
                CredentialKind.TOKEN,
                timedelta(hours=1),
                name="test",
                reach=Reach(scopes=frozenset(scopes)),
            )
        return {"authorization": f"Bearer {secret}"}

    def instructor(self, who: str = "grace", course: str = COURSE) -> Member:
        with self.store.transaction() as session:
            return membership.make_instructor(session, course, Student(who, who.capitalize()))

    def student(self, who: str = "ada", course: str = COURSE) -> Member:
        with self.store.transaction() as session:
            return membership.make_student(session, course, Student(who, who.capitalize()))

    def join(self, member: Member, other: Member, *, from_platform: bool = False) -> None:
        """Merge two members into one person, as an operator does."""
        service = self.app.state.context.service
        request = JoinRequest(member.enrolment_id, other.enrolment_id, from_platform)
        operations.join(service, Actor("operator", operator=True), request)

    def operator(self, who: str = "root") -> Member:
        member = self.instructor(who, "operators")
        with self.store.transaction() as session:
            membership.make_operator(session, member.person_id)
        return member


@contextmanager
def web_in(folder: Path, **changes: Any) -> Iterator[Web]:
    """Yield an application with its home in ``folder``."""
    settings = settings_in(folder, **changes)
    if not settings.broker_url:
        settings = settings.with_broker(build_broker_url(settings))
    with opened(settings) as store:
        yield Web(settings, store, make_app(settings, store))


def csrf(answer: Response) -> str:
    """Return the CSRF token in the forms of a page."""
    match = re.search(r'name="csrf" value="([0-9a-f]+)"', answer.text)
    assert match, answer.text[:2000]
    return unescape(match[1])


def submit(client: TestClient, path: str, data: dict[str, Any] | None = None, **options: Any) -> Response:
    """Post a form as its page would."""
    word = csrf(client.get("/account"))
    return client.post(path, data={**(data or {}), "csrf": word}, **options)


def words(html: str) -> str:
    """Return the text of a page."""
    body = html[html.find("<main") :]
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", body)).split())


def grade_all(web: Web, grade: Grade) -> None:
    """Give all waiting jobs this grade at once, without a worker."""
    while claim := jobs.claim_job(web.store, "worker", 60):
        jobs.finish_job(web.store, claim, prepared(grade), datetime.now(UTC))
