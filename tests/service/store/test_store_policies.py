"""Deadlines, late days, attempts, cool-downs and extensions: submissions over a limit are marked for staff only."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from sqlalchemy import select

import acting
import report_builders
from builders import grading_request, prepared
from service.operations.regrades import PublicationCounts
from service.store.batches import job_lines
from service.store.batches.intake import AcceptedSubmission, accept_batch, accept_new_submissions, accept_submission
from service.store.courses import policies
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store, now
from service.store.people.students import Students, ensure_course
from service.store.queue import jobs
from service.store.states import JobQueue, JobState
from service.store.tables.submissions import Job, SubmissionRow
from sim.recording import Verdict
from submissions.student_identity import Student

GRADE = report_builders.faulty_grade()
DUE = datetime(2026, 11, 30, 17, 0, tzinfo=UTC)
DAY = timedelta(days=1)


def _set(store: Store, allowed: PolicyLimits, assignment: str = "") -> None:
    with store.transaction() as session:
        policies.set_policy(session, ensure_course(session, "default", now(session)), assignment, allowed)


def _extend(store: Store, student: str, due_at: datetime | None = None, more: int = 0, assignment: str = "") -> None:
    with store.transaction() as session:
        at = now(session)
        policies.extend_policy(
            session,
            Students(session, ensure_course(session, "default", at)).enrol(Student(student), at),
            assignment,
            due_at,
            more,
        )


def _request(store: Store, program: int, at: datetime | None = None, student: str = "ada") -> AcceptedSubmission:
    taken = replace(grading_request(student, f"print({program})\n"), submitted_at=at)
    batch = accept_new_submissions(store, "class", [taken], [], max_attempts=3).batch
    assert batch is not None
    return batch.jobs[0]


def _grade_all(store: Store, verdict: Verdict | None = None) -> None:
    grade = GRADE
    if verdict is not None:
        (trial, *rest) = GRADE.trials
        grade = replace(GRADE, trials=(replace(trial, recording=replace(trial.recording, verdict=verdict)), *rest))
    while (claim := jobs.claim_job(store, "worker", 60)) is not None:
        jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))


def test_without_a_policy_everything_counts(store: Store) -> None:
    for number in range(5):
        assert _request(store, number, DUE + number * DAY).staff_only == ""
        _grade_all(store)


def test_attempts_are_different_submissions_that_were_graded(store: Store) -> None:
    _set(store, PolicyLimits(attempts=2))
    # Not attempts: superseded before the start, a fault of the assignment or the host, the same files again.
    assert _request(store, 1).staff_only == ""
    assert _request(store, 2).staff_only == ""
    _grade_all(store, Verdict.ASSIGNMENT_ERROR)
    assert _request(store, 3).staff_only == ""
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.give_up_job(store, claim, "the disk is full")
    assert _request(store, 4).staff_only == ""
    _grade_all(store)
    assert _request(store, 5).staff_only == ""
    _grade_all(store)
    over = _request(store, 6)
    assert over.staff_only == "attempt 3, allowed: 2"
    assert _request(store, 4).staff_only == ""
    assert _request(store, 1, student="bob").staff_only == ""


def test_what_is_over_is_marked_but_neither_supersedes_nor_is_published(store: Store) -> None:
    _set(store, PolicyLimits(attempts=1))
    first = _request(store, 1)
    _grade_all(store)
    over = _request(store, 2)
    assert _request(store, 3).staff_only
    with store.reading() as session:
        job = session.get_one(Job, over.job_id)
        assert (job.state, job.lane) == (JobState.QUEUED, JobQueue.BATCH)
        batch = session.get_one(SubmissionRow, job.submission_id).batch_id
    assert batch is not None
    _grade_all(store)
    with store.reading() as session:
        (own,) = job_lines.load_attempt_lines(session, batch)
        assert (own.marks, own.staff_only) == (GRADE.marks, "attempt 2, allowed: 1")
        (line,) = job_lines.load_job_lines(session, batch)
        assert (line.id, line.newer_attempt) == (first.job_id, 3)
        assert session.get_one(Job, first.job_id).state is JobState.DONE
    assert acting.publish(store, batch, actor="staff") == PublicationCounts(0, 0, 0, 0, 1, 0)


@pytest.mark.parametrize(
    ("after", "days_late", "over"),
    [
        (timedelta(0), 0, ""),
        (timedelta(seconds=1), 1, ""),
        (2 * DAY, 2, ""),
        (2 * DAY + timedelta(seconds=1), 3, "3 days late, allowed: 2"),
        (-DAY, 0, ""),
    ],
)
def test_late_days(store: Store, after: timedelta, days_late: int, over: str) -> None:
    _set(store, PolicyLimits(DUE, late_days=2))
    accepted = _request(store, 1, DUE + after)
    with store.reading() as session:
        assert session.scalars(select(SubmissionRow.days_late)).one() == days_late
    assert accepted.staff_only == over


def test_a_moment_that_nobody_knows_is_in_time_and_staff_may_always(store: Store) -> None:
    _set(store, PolicyLimits(DUE - 10_000 * DAY, attempts=1))
    assert _request(store, 1).staff_only == ""
    _grade_all(store)
    batch = accept_batch(store, "class", [grading_request("ada", "print(2)\n")], [], max_attempts=3)
    assert batch.jobs[0].staff_only == ""


def test_a_cool_down_counts_from_the_one_before(store: Store) -> None:
    _set(store, PolicyLimits(cool_down_seconds=600))
    assert _request(store, 1, DUE).staff_only == ""
    _grade_all(store)
    over = _request(store, 2, DUE + timedelta(minutes=9))
    assert over.staff_only == "submitted 9 min after the previous submission, required: 10 min"
    # A submission over the limit does not count itself.
    assert _request(store, 3, DUE + timedelta(minutes=10)).staff_only == ""


def test_what_a_person_submits_is_submitted_now(store: Store) -> None:
    _set(store, PolicyLimits(datetime.now(UTC) - DAY, late_days=2, cool_down_seconds=3600))
    first = accept_submission(store, grading_request("ada", "print(1)\n"), max_attempts=3)
    assert first.staff_only == ""
    _grade_all(store)
    assert "0 min after" in accept_submission(store, grading_request("ada", "print(2)\n"), max_attempts=3).staff_only
    with store.reading() as session:
        assert session.scalars(select(SubmissionRow.days_late)).all() == [2, 2]


def test_extensions_are_one_students_own_and_hold_together(store: Store) -> None:
    _set(store, PolicyLimits(DUE, attempts=1))
    _set(store, PolicyLimits(DUE + DAY, attempts=1), "echo-responder")
    _extend(store, "ada", DUE + 3 * DAY, more=1)
    assert _request(store, 1, DUE + DAY).staff_only == ""
    _grade_all(store)
    assert _request(store, 2, DUE + 3 * DAY).staff_only == ""
    _grade_all(store)
    assert "attempt 3" in _request(store, 3, DUE).staff_only
    assert "late" in _request(store, 1, DUE + 2 * DAY, "bob").staff_only
    _extend(store, "cid", DUE + 5 * DAY)
    _extend(store, "cid", DUE - DAY, assignment="echo-responder")
    # An extension never reduces the general limits.
    assert _request(store, 1, DUE + DAY, "cid").staff_only == ""
    assert "late" in _request(store, 2, DUE + 6 * DAY, "cid").staff_only


def test_what_is_hidden_opens_when_nobody_can_submission_any_more_or_when_published(store: Store) -> None:
    _set(store, PolicyLimits(datetime.now(UTC) - DAY, late_days=0))
    job_id = _request(store, 1).job_id
    _grade_all(store)

    def released() -> frozenset[str]:
        with store.reading() as session:
            return policies.load_visibilities(session, job_id)

    assert released() == {"visible", "after_due_date"}
    _set(store, PolicyLimits(datetime.now(UTC) - DAY, late_days=2))
    assert released() == {"visible"}
    _set(store, PolicyLimits(datetime.now(UTC) - DAY))
    _extend(store, "somebody else", datetime.now(UTC) + DAY)
    assert released() == {"visible"}
    with store.reading() as session:
        batch = session.scalars(select(Job.batch_id)).one()
    assert batch is not None
    acting.publish(store, batch, actor="staff")
    assert released() == {"visible", "after_due_date", "after_published"}


def _moment(text: str) -> datetime:
    """Return a wall-clock time in Berlin: from UTC+1 to UTC+2 on 29 March 2026, and back on 25 October."""
    return datetime.fromisoformat(text).replace(tzinfo=ZoneInfo("Europe/Berlin"))


@pytest.mark.parametrize(
    ("due", "submitted", "days_late", "counts"),
    [
        ("2026-10-24T23:59", "2026-10-25T23:30", 1, True),  # a day of 25 hours
        ("2026-10-24T23:59", "2026-10-26T00:00", 2, False),
        ("2026-10-24T02:30", "2026-10-25T02:15", 1, True),
        ("2026-03-28T23:59", "2026-03-29T23:30", 1, True),  # a day of 23 hours
        ("2026-03-28T23:59", "2026-03-30T00:30", 2, False),
        ("2026-03-28T02:30", "2026-03-29T03:15", 1, True),  # 02:30 does not exist that day
        ("2026-03-28T02:30", "2026-03-29T03:45", 2, False),
        ("2026-11-30T17:00", "2026-11-30T17:00", 0, True),
        ("2026-11-30T17:00", "2026-12-01T17:00", 1, True),
    ],
)
def test_late_days_are_days_of_the_calendar(
    store: Store, monkeypatch: pytest.MonkeyPatch, due: str, submitted: str, days_late: int, counts: bool
) -> None:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    _set(store, PolicyLimits(_moment(due), late_days=1))
    # Days are counted in the time zone that the policy was set in.
    monkeypatch.setenv("TZ", "America/New_York")
    with store.transaction() as session:
        enrolment_id = Students(session, 1).enrol(Student("ada"), now(session))
        ruling = policies.apply_policy(session, enrolment_id, "echo-responder", "0", _moment(submitted))
        closed_at = policies.load_limits(session, enrolment_id, "echo-responder").closed_at
    assert (ruling.days_late, not ruling.over) == (days_late, counts)
    assert closed_at is not None
    assert (_moment(submitted) <= closed_at) is counts


def test_a_day_has_passed_for_students_and_rulings_at_the_same_moment() -> None:
    """Every hour around both clock changes: an assignment closes exactly when submissions become too late."""
    for due in ("2026-03-27T02:30", "2026-03-28T12:00", "2026-10-24T02:30", "2026-10-25T02:30"):
        for late_days in range(3):
            allowed = PolicyLimits(_moment(due), late_days, zone="Europe/Berlin")
            assert allowed.closed_at is not None
            for hour in range(100):
                at = _moment(due).astimezone(UTC) + timedelta(minutes=30 * hour)
                assert (allowed.days_late(at) > late_days) is (at > allowed.closed_at), (due, late_days, at)


@pytest.mark.parametrize(
    ("general", "particular", "due", "attempts"),
    [
        ((DUE + 7 * DAY, 0), (None, 1), DUE + 7 * DAY, 3),
        ((DUE + 7 * DAY, 0), (DUE + DAY, 1), DUE + 7 * DAY, 3),
        ((None, 3), (DUE + DAY, 1), DUE + DAY, 5),
        ((DUE - DAY, 0), (None, 0), DUE, 2),
    ],
)
def test_a_general_and_a_particular_extension_hold_together(
    store: Store,
    general: tuple[datetime | None, int],
    particular: tuple[datetime | None, int],
    due: datetime,
    attempts: int,
) -> None:
    _set(store, PolicyLimits(DUE, attempts=2))
    for assignment, (due_at, more) in (("", general), ("echo-responder", particular)):
        _extend(store, "ada", due_at, more, assignment)
    with store.transaction() as session:
        enrolment_id = Students(session, 1).enrol(Student("ada"), now(session))
        allowed = policies.load_limits(session, enrolment_id, "echo-responder")
        elsewhere = policies.load_limits(session, enrolment_id, "another")
    assert (allowed.due_at, allowed.attempts) == (due, attempts)
    assert (elsewhere.due_at, elsewhere.attempts) == (max(DUE, general[0] or DUE), 2 + general[1])
