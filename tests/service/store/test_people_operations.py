"""Persons are merged, signed out and removed, and their tokens counted, on each kind of database."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from typing import cast

import pytest
from sqlalchemy import select

from service.operations import credentials as own
from service.operations import people as operations
from service.operations.context import Actor, Service
from service.operations.credentials import TokenRequest
from service.operations.errors import Conflict, NotFound
from service.operations.people import JoinRequest, TokenForRequest
from service.queue.notifier import Notifier
from service.settings import Settings
from service.store import audit
from service.store.engine import Store, now
from service.store.locks import lock_course
from service.store.people import credentials, membership
from service.store.people.credentials import MAX_TOKENS
from service.store.people.membership import Member
from service.store.people.students import Students
from service.store.states import CredentialKind, Role
from service.store.tables.people import Enrolment, Person
from submissions.student_identity import Student

ROOT = Actor("root", operator=True)


@pytest.fixture
def service(service_settings: Settings, store: Store) -> Service:
    return Service(service_settings, store, cast(Notifier, None))


def instructor(service: Service, course: str, who: str = "grace") -> Member:
    with service.store.transaction() as session:
        return membership.make_instructor(session, course, Student(who))


def test_two_persons_become_one_who_signs_in_anew(service: Service) -> None:
    one, two = instructor(service, "one"), instructor(service, "two")
    secrets = []
    with service.store.transaction() as session:
        membership.make_operator(session, two.person_id)
        for each in (one, two):
            lifetime = credentials.SESSION_LIFETIME
            secrets.append(credentials.issue_credential(session, each.person_id, CredentialKind.SESSION, lifetime))
    joined = operations.join(service, ROOT, JoinRequest(one.enrolment_id, two.enrolment_id))
    assert (joined.person_id, joined.operator) == (one.person_id, True)
    with service.store.reading() as session:
        assert set(session.scalars(select(Enrolment.person_id))) == {one.person_id}
        assert session.get(Person, two.person_id) is None
        assert [credentials.identify(session, each, CredentialKind.SESSION) for each in secrets] == [None, None]
        (entry,) = audit.load_entries(session, "person", str(one.person_id))
    assert (entry.action, entry.actor, entry.detail["joined"]) == ("join", "root", two.person_id)


def test_persons_are_not_joined_if_one_enters_a_course_of_the_other_meanwhile(service: Service) -> None:
    one, two = instructor(service, "one"), instructor(service, "two")
    with ThreadPoolExecutor(1) as pool:
        with service.store.transaction() as session:
            lock_course(session, two.course_id)
            enrolment_id = Students(session, two.course_id).enrol(Student("grace2"), now(session))
            session.get_one(Enrolment, enrolment_id).person_id = one.person_id
            session.flush()
            joined = pool.submit(operations.join, service, ROOT, JoinRequest(one.enrolment_id, two.enrolment_id))
            # On PostgreSQL it waits for this transaction; on SQLite it has not begun.
            time.sleep(0.5)
        with pytest.raises(Conflict, match="both accounts are in the course"):
            joined.result()


def test_nobody_but_an_operator_joins_and_signs_out(service: Service) -> None:
    one, two = instructor(service, "one"), instructor(service, "two")
    grace = Actor("grace", one.person_id, roles={one.course_id: Role.INSTRUCTOR})
    for refused in (
        lambda: operations.join(service, grace, JoinRequest(one.enrolment_id, two.enrolment_id)),
        lambda: operations.sign_out(service, grace, one.enrolment_id),
        lambda: operations.show(service, grace, one.enrolment_id),
        lambda: operations.find(service, grace, "one", "grace"),
        lambda: operations.issue_token(service, grace, one.enrolment_id, TokenForRequest("t", frozenset({"read"}), 1)),
        lambda: operations.remove(service, grace, one.course_id, one.enrolment_id),
        lambda: operations.remove(service, grace, two.course_id, two.enrolment_id),
    ):
        with pytest.raises(NotFound):
            refused()


def test_tokens_are_bounded_however_many_are_asked_for_at_once(service: Service) -> None:
    member = instructor(service, "one")
    grace = Actor("grace", member.person_id, roles={member.course_id: Role.INSTRUCTOR})

    def make(number: int) -> bool:
        try:
            own.make_token(service, grace, TokenRequest("t", frozenset({"read"}), 1, f"word {number}"))
        except Conflict:
            return False
        return True

    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(make, range(MAX_TOKENS + 4)))
    assert made.count(True) == MAX_TOKENS
    listed = own.list_credentials(service, grace)
    assert len(listed) == MAX_TOKENS
    own.end_credential(service, grace, listed[0].id)
    assert make(1000)


def test_an_operator_removes_an_instructor(service: Service) -> None:
    one, two = instructor(service, "one"), instructor(service, "one", "linus")
    secret = operations.issue_token(
        service, ROOT, one.enrolment_id, TokenForRequest("t", frozenset({"read", "manage"}), 1)
    )
    with pytest.raises(NotFound):
        operations.remove(service, ROOT, one.course_id + 1, one.enrolment_id)
    operations.remove(service, ROOT, one.course_id, one.enrolment_id)
    with service.store.reading() as session:
        assert [each.person_id for each in membership.list_members(session, one.course_id)] == [two.person_id]
        assert credentials.identify(session, secret, CredentialKind.TOKEN) is None
