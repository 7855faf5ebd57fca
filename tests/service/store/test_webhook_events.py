"""Webhook deliveries are stored with their cause, claimed once, retried, and given up after a day."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import select, update

import acting
import report_builders
from acting import service_on
from builders import accept_one, grading_request, prepared
from naming import is_named
from service.operations import replies
from service.operations.context import Actor
from service.store import ids, webhook_events
from service.store.batches import intake
from service.store.engine import Store
from service.store.people import credentials, membership, webhooks
from service.store.people.reach import Reach
from service.store.queue import jobs
from service.store.states import CredentialKind
from service.store.tables.courses import Course, Delivery
from sim.errors import UsageError
from submissions.student_identity import Student

EVENTS = ["grade.finished", "batch.finished", "grades.published", "appeal.opened"]


def hook(store: Store, *events: str) -> str:
    with store.transaction() as session:
        if session.get(Course, 1) is None:
            session.add(Course(id=1, name="default", created_at=datetime.now(UTC)))
            session.flush()
        return webhooks.create_webhook(session, 1, "https://hooks.example.org/x", events or EVENTS)[0].id


def list_deliveries(store: Store) -> list[tuple[str, dict[str, Any]]]:
    with store.reading() as session:
        rows = session.scalars(select(Delivery).order_by(Delivery.made_at, Delivery.event.desc())).all()
        return [(row.event, row.payload["data"]) for row in rows]


def grade_next(store: Store) -> str:
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    return claim.job_id


def submit(store: Store, *students: str) -> str:
    requests = [grading_request(each) for each in students]
    return intake.accept_batch(store, "batch", requests, (), course="default", max_attempts=1).id


def test_a_batch_is_told_of_job_by_job_and_once_when_it_is_finished(store: Store) -> None:
    hook(store)
    batch = submit(store, "ada", "bob")
    first, second = grade_next(store), grade_next(store)
    assert [(event, data.get("job")) for event, data in list_deliveries(store)] == [
        ("grade.finished", first),
        ("grade.finished", second),
        ("batch.finished", None),
    ]
    assert list_deliveries(store)[-1][1] == {"batch": batch, "states": {"done": 2}}
    acting.publish(store, batch, actor="grace")
    assert list_deliveries(store)[-1] == ("grades.published", {"batch": batch, "published": 2})


def test_nobody_is_named(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    # Ids that contain the name do not identify a student.
    monkeypatch.setattr(ids, "ALPHABET", "ad")
    hook(store)
    submit(store, "ada")
    grade_next(store)
    assert not is_named("ada", str(list_deliveries(store)))


def test_what_ends_without_a_grade_ends_its_batch_too(store: Store) -> None:
    hook(store, "batch.finished")
    batch = submit(store, "ada")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.give_up_job(store, claim, "the disk is full")
    cancelled = submit(store, "bob")
    acting.cancel(store, cancelled)
    superseded = submit(store, "carol")
    accept_one(store, "carol")
    assert [(data["batch"], data["states"]) for _, data in list_deliveries(store)] == [
        (batch, {"dead": 1}),
        (cancelled, {"cancelled": 1}),
        (superseded, {"cancelled": 1}),
    ]


def test_without_webhooks_nothing_is_written(store: Store) -> None:
    revoked = hook(store)
    with store.transaction() as session:
        assert webhooks.revoke_webhook(session, 1, revoked)
    submit(store, "ada")
    grade_next(store)
    assert list_deliveries(store) == []


def test_only_one_sender_has_a_delivery(store: Store) -> None:
    hook(store, "grade.finished")
    submit(store, "ada")
    grade_next(store)
    (claimed,) = webhook_events.claim_deliveries(store, 8)
    assert claimed.attempt == 1
    assert webhook_events.claim_deliveries(store, 8) == []
    webhook_events.record_delivery(store, claimed)
    _past(store, timedelta(hours=1))
    assert webhook_events.claim_deliveries(store, 8) == []


def test_what_does_not_arrive_is_tried_again_ever_later_and_given_up_after_a_day(store: Store) -> None:
    hook(store, "grade.finished")
    submit(store, "ada")
    grade_next(store)
    waits = []
    for _ in range(40):
        due = webhook_events.claim_deliveries(store, 8)
        if not due:
            break
        before = datetime.now(UTC)
        webhook_events.record_failure(store, due[0], "answered 500")
        with store.reading() as session:
            row = session.scalars(select(Delivery)).one()
        if row.due_at is None:
            break
        waits.append(round((row.due_at - before).total_seconds()))
        _past(store, row.due_at - before + timedelta(seconds=1))
    assert row.due_at is None
    assert (row.delivered_at, row.error) == (None, "answered 500")
    assert waits == sorted(waits)
    assert waits[0] < 20
    assert 10 < len(waits) < 30


def test_slow_receivers_of_a_course_delay_no_other_course(store: Store) -> None:
    for course_id, hooks, deliveries in ((1, 10, 5), (2, 1, 2)):
        _add_due_deliveries(store, course_id, hooks, deliveries)
    slow = webhook_events.claim_deliveries(store, 8)
    fast = [each for each in slow if each.payload["course"] == 2]
    assert [each.payload["course"] for each in slow].count(1) == 7
    # One delivery of each webhook is sent at a time. A course with fewer of them is first.
    for each in fast:
        webhook_events.record_delivery(store, each)
    (after,) = webhook_events.claim_deliveries(store, 1)
    assert [each.payload["course"] for each in (*fast, after)] == [2, 2]
    rest = webhook_events.claim_deliveries(store, 8)
    assert [each.payload["course"] for each in rest] == [1, 1, 1]
    assert len({each.url for each in (*slow, *rest)}) == 11
    assert webhook_events.claim_deliveries(store, 8) == []
    webhook_events.record_failure(store, slow[0] if slow[0] not in fast else slow[1], "answered 500")
    assert len(webhook_events.claim_deliveries(store, 8)) == 1


def test_of_two_senders_one_claims_a_webhooks_delivery(store: Store) -> None:
    _add_due_deliveries(store, 1, 3, 5)
    with ThreadPoolExecutor(4) as pool:
        claimed = [
            each
            for claims in pool.map(lambda _: webhook_events.claim_deliveries(store, 8), range(4))
            for each in claims
        ]
    assert len(claimed) == len({each.url for each in claimed}) == 3


def test_of_two_workers_that_end_a_batch_at_once_one_says_so(store: Store) -> None:
    hook(store, "batch.finished")
    for _ in range(5):
        batch = submit(store, "ada", "bob")
        claims = [jobs.claim_job(store, "worker", 60) for _ in range(2)]
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(lambda claim: jobs.give_up_job(store, claim, "the disk is full"), claims))
        assert list_deliveries(store)[-1] == ("batch.finished", {"batch": batch, "states": {"dead": 2}})
    assert len(list_deliveries(store)) == 5


def test_of_two_requests_with_a_key_one_holds_it(store: Store) -> None:
    with store.transaction() as session:
        person_id = membership.make_instructor(session, "default", Student("grace")).person_id
        credentials.issue_credential(
            session,
            person_id,
            CredentialKind.TOKEN,
            timedelta(hours=1),
            name="t",
            reach=Reach(scopes=frozenset({"read"})),
        )
        (token,) = credentials.list_credentials(session, person_id)
    key_arguments = (service_on(store), Actor("grace", person_id, credential_id=token.id), "k")

    def begin(_: int) -> str:
        try:
            return "holds it" if replies.reserve_key(*key_arguments) is None else "answered"
        except replies.InProgress:
            return "waits"

    with ThreadPoolExecutor(4) as pool:
        assert sorted(pool.map(begin, range(4))) == ["holds it", "waits", "waits", "waits"]
    replies.store_reply(*key_arguments, replies.StoredReply("a" * 64, 201, b"{}"))
    assert replies.reserve_key(*key_arguments) == replies.StoredReply("a" * 64, 201, b"{}")


def test_what_waits_for_a_revoked_webhook_is_not_sent(store: Store) -> None:
    revoked = hook(store, "grade.finished")
    submit(store, "ada")
    grade_next(store)
    with store.transaction() as session:
        assert not webhooks.revoke_webhook(session, 2, revoked)
        assert webhooks.revoke_webhook(session, 1, revoked)
    assert webhook_events.claim_deliveries(store, 8) == []


def test_addresses_that_are_none_are_refused(store: Store) -> None:
    hook(store)
    urls = (
        "",
        "ftp://example.org/",
        "https://",
        "https://user:word@example.org/",
        "https://example.org/ x",
        "https://example.org/\r\nHost: x",
        "https://exämple.org/",
        "https://example.org:99999/",
        "javascript:alert(1)",
    )
    for url in urls:
        with store.transaction() as session, pytest.raises(UsageError, match=r"^url: "):
            webhooks.create_webhook(session, 1, url, EVENTS)


def _past(store: Store, time: timedelta) -> None:
    """Simulate the passing of this time for waiting deliveries."""
    with store.transaction() as session:
        for row in session.scalars(select(Delivery)).all():
            due_at = None if row.due_at is None else row.due_at - time
            values = {"made_at": row.made_at - time, "due_at": due_at}
            session.execute(update(Delivery).where(Delivery.id == row.id).values(**values))


def _add_due_deliveries(store: Store, course_id: int, hooks: int, deliveries: int) -> None:
    """Create webhooks in a course, each with this number of due deliveries."""
    with store.transaction() as session:
        session.add(Course(id=course_id, name=f"course {course_id}", created_at=datetime.now(UTC)))
        session.flush()
        for number in range(hooks):
            webhooks.create_webhook(session, course_id, f"https://hooks.example.org/{course_id}/{number}", EVENTS)
        for number in range(deliveries):
            webhook_events.emit_grades_published(session, course_id, batch="b", published=number)
