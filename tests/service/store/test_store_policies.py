"""Due dates, late days, attempts, cool-downs and extensions: what is over a limit is marked, for staff only."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import select

import report_builders
from builders import grading_request
from service.store.batches import batches, publishing
from service.store.batches.intake import Accepted, accept, accept_batch, accept_new
from service.store.courses import policies
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store, now
from service.store.grades import results
from service.store.models import Job, SubmissionRow
from service.store.people.students import Students, course_of
from service.store.queue import jobs
from service.store.states import JobState, Lane
from sim.recording import Verdict
from submissions.people import Student

GRADE = report_builders.faulty_grade()
DUE = datetime(2026, 11, 30, 17, 0, tzinfo=UTC)
DAY = timedelta(days=1)


def _set(store: Store, allowed: PolicyLimits, assignment: str = "") -> None:
    with store.transaction() as session:
        policies.set_policy(session, course_of(session, "default", now(session)), assignment, allowed)


def _extend(store: Store, student: str, due_at: datetime | None = None, more: int = 0, assignment: str = "") -> None:
    with store.transaction() as session:
        at = now(session)
        policies.extend(
            session,
            Students(session, course_of(session, "default", at)).enrol(Student(student), at),
            assignment,
            due_at,
            more,
        )


def _request(store: Store, program: int, at: datetime | None = None, student: str = "ada") -> Accepted:
    taken = replace(grading_request(student, f"print({program})\n"), submitted_at=at)
    batch = accept_new(store, "class", [taken], [], max_attempts=3).batch
    assert batch is not None
    return batch.jobs[0]


def _grade_all(store: Store, verdict: Verdict | None = None) -> None:
    grade = GRADE
    if verdict is not None:
        (trial, *rest) = GRADE.trials
        grade = replace(GRADE, trials=(replace(trial, recording=replace(trial.recording, verdict=verdict)), *rest))
    while (claim := jobs.claim(store, "worker", 60)) is not None:
        jobs.finish(store, claim, results.prepare(grade), datetime.now(UTC))


def test_without_a_policy_everything_counts(store: Store) -> None:
    for number in range(5):
        assert _request(store, number, DUE + number * DAY).staff_only == ""
        _grade_all(store)


def test_attempts_are_different_submissions_that_were_graded(store: Store) -> None:
    _set(store, PolicyLimits(attempts=2))
    # Superseded before it began, a fault of the assignment's or of ours, the same again: none is an attempt.
    assert _request(store, 1).staff_only == ""
    assert _request(store, 2).staff_only == ""
    _grade_all(store, Verdict.ASSIGNMENT_ERROR)
    assert _request(store, 3).staff_only == ""
    claim = jobs.claim(store, "worker", 60)
    assert claim is not None
    jobs.give_up(store, claim, "the disk is full")
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
        assert (job.state, job.lane) == (JobState.QUEUED, Lane.BATCH)
        batch = session.get_one(SubmissionRow, job.submission_id).batch_id
    assert batch is not None
    _grade_all(store)
    with store.reading() as session:
        (line,) = batches.job_lines(session, batch)
        assert (line.marks, line.staff_only) == (GRADE.marks, "attempt 2, allowed: 1")
        assert session.get_one(Job, first.job_id).state is JobState.DONE
    assert publishing.publish(store, batch, actor="staff") == publishing.Published(0, 0, 0, 0, 1, 0)


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
    assert over.staff_only == "submitted 9 min after the one before, asked for: 10 min"
    # What was over does not itself count.
    assert _request(store, 3, DUE + timedelta(minutes=10)).staff_only == ""


def test_what_a_person_submits_is_submitted_now(store: Store) -> None:
    _set(store, PolicyLimits(datetime.now(UTC) - DAY, late_days=2, cool_down_seconds=3600))
    first = accept(store, grading_request("ada", "print(1)\n"), max_attempts=3)
    assert first.staff_only == ""
    _grade_all(store)
    assert "0 min after" in accept(store, grading_request("ada", "print(2)\n"), max_attempts=3).staff_only
    with store.reading() as session:
        assert session.scalars(select(SubmissionRow.days_late)).all() == [2, 2]


def test_extensions_are_one_students_own_and_the_more_special_wins(store: Store) -> None:
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
    # An extension never takes away what all have.
    assert _request(store, 1, DUE + DAY, "cid").staff_only == ""
    assert "late" in _request(store, 2, DUE + 4 * DAY, "cid").staff_only


def test_what_is_hidden_opens_when_nobody_can_submission_any_more_or_when_published(store: Store) -> None:
    _set(store, PolicyLimits(datetime.now(UTC) - DAY, late_days=0))
    job_id = _request(store, 1).job_id
    _grade_all(store)

    def released() -> frozenset[str]:
        with store.reading() as session:
            return policies.released(session, job_id)

    assert released() == {"visible", "after_due_date"}
    _set(store, PolicyLimits(datetime.now(UTC) - DAY, late_days=2))
    assert released() == {"visible"}
    _set(store, PolicyLimits(datetime.now(UTC) - DAY))
    _extend(store, "somebody else", datetime.now(UTC) + DAY)
    assert released() == {"visible"}
    with store.reading() as session:
        batch = session.scalars(select(Job.batch_id)).one()
    assert batch is not None
    publishing.publish(store, batch, actor="staff")
    assert released() == {"visible", "after_due_date", "after_published"}
