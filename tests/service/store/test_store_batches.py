"""Whole batches in the store: submitted again, superseded, paused, cancelled, retried."""

from __future__ import annotations

from dataclasses import replace

import pytest
from sqlalchemy import func, select

import acting
from builders import echo, grading_request
from service.operations.batches import BatchControlResult, RetryCounts
from service.store.batches import batches, job_lines
from service.store.batches.intake import accept_batch, accept_new_submissions, accept_submission
from service.store.batches.job_lines import JobLine
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.hidden_names import load_hidden_names
from service.store.engine import Store
from service.store.queue import jobs
from service.store.queue.lease_reaper import count_missing_notices
from service.store.states import BatchState, JobQueue, JobState
from service.store.tables.submissions import Batch, Job, SubmissionRow
from sim.errors import UsageError
from submissions.grading_request import GradingRequest

pytestmark = pytest.mark.fast

OTHER = "print('other')\n"


def _take(store: Store, *grading_requests: GradingRequest) -> str:
    return accept_batch(store, "class", grading_requests, [], max_attempts=2).id


def _die(store: Store) -> str:
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.give_up_job(store, claim, "the disk is full")
    return claim.job_id


def _states(store: Store) -> list[tuple[int, JobState]]:
    """Return the student's attempt and the state of every job, sorted."""
    query = select(SubmissionRow.attempt, Job.state).join(Job, Job.submission_id == SubmissionRow.id)
    with store.reading() as session:
        return sorted((attempt, state) for attempt, state in session.execute(query))


def test_a_batch_of_the_web_has_each_student_once_and_an_uploaded_one_says_nothing_of_it(store: Store) -> None:
    uploaded = _take(store, grading_request("ada"))
    with store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.open_for_students(session, 1, echo().id)
        web = open_assignments.load_course_assignment(session, 1, echo().id).batch_id
        open_assignments.close_assignment(session, 1, echo().id)
        open_assignments.open_for_students(session, 1, echo().id)
        assert open_assignments.load_course_assignment(session, 1, echo().id).batch_id == web
    assert web is not None
    for program in ("print(1)\n", "print(2)\n"):
        accept_submission(store, grading_request("ada", program), max_attempts=2, batch_id=web)
    with store.reading() as session:
        lines = {line.id: line for line in batches.list_batches(session)}
        assert [line.attempt for line in job_lines.load_job_lines(session, web)] == [3]
    assert (lines[web].jobs, lines[web].states) == (1, {JobState.QUEUED: 1})
    assert (lines[web].web_assignment, lines[web].takes_in) == (echo().id, True)
    assert (lines[uploaded].web_assignment, lines[uploaded].takes_in) == (None, False)
    assert lines[uploaded].states == {JobState.CANCELLED: 1}


@pytest.mark.parametrize("hidden", [True, False], ids=["names hidden", "names shown"])
def test_lines_in_pages_miss_and_double_nothing_and_their_order_tells_no_hidden_name(
    store: Store, hidden: bool
) -> None:
    batch_id = _take(store, *(grading_request(f"s{number}", f"print({number})\n") for number in range(8)))
    with store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.hide_names(session, 1, echo().id, hidden)
    names = load_hidden_names(store, 1)
    lines: list[JobLine] = []
    with store.reading() as session:
        while page := job_lines.load_job_lines_page(session, batch_id, names, 3, lines[-1].id if lines else None):
            lines += page
    assert len({line.id for line in lines}) == len(lines) == 8
    ordered = [line.id if hidden else line.student for line in lines]
    assert ordered == sorted(ordered)
    assert all(line.student.startswith("Participant ") == hidden for line in lines)


def test_the_same_batch_again_changes_nothing(store: Store) -> None:
    class_ = [grading_request("ada"), grading_request("bob")]
    first = accept_new_submissions(store, "class", class_, [], max_attempts=2)
    assert first.batch is not None
    assert first.known == ()
    again = accept_new_submissions(store, "class", class_, [], max_attempts=2)
    assert again.batch is None
    assert [known.job_id for known in again.known] == [job.job_id for job in first.batch.jobs]
    with store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Batch)) == 1
    assert _states(store) == [(1, JobState.QUEUED)] * 2


@pytest.mark.parametrize(
    "changed",
    [grading_request("ada", OTHER), grading_request("ada", assignment=replace(echo(), title="Another title"))],
    ids=["other bytes", "other version of the assignment"],
)
def test_only_what_differs_is_taken_in_and_supersedes(store: Store, changed: GradingRequest) -> None:
    accept_new_submissions(store, "class", [grading_request("ada"), grading_request("bob")], [], max_attempts=2)
    second = accept_new_submissions(store, "class", [changed, grading_request("bob")], [], max_attempts=2)
    assert second.batch is not None
    (new,) = second.batch.jobs
    assert (new.student, new.attempt) == ("ada", 2)
    assert [known.student for known in second.known] == ["bob"]
    assert _states(store) == [(1, JobState.CANCELLED), (1, JobState.QUEUED), (2, JobState.QUEUED)]
    with store.reading() as session:
        reason = session.scalars(select(Job.error).where(Job.state == JobState.CANCELLED)).one()
    assert reason == f"superseded by {new.job_id}"


def test_going_back_to_an_earlier_submission_is_a_new_attempt(store: Store) -> None:
    for program in (OTHER, "print('hello')\n", OTHER):
        accept_new_submissions(store, "class", [grading_request("ada", program)], [], max_attempts=2)
    assert _states(store) == [(1, JobState.CANCELLED), (2, JobState.CANCELLED), (3, JobState.QUEUED)]


def test_what_was_cancelled_comes_in_again(store: Store) -> None:
    first = accept_new_submissions(store, "class", [grading_request("ada"), grading_request("bob")], [], max_attempts=2)
    assert first.batch is not None
    _die(store)
    acting.cancel(store, first.batch.id)
    again = accept_new_submissions(store, "class", [grading_request("ada"), grading_request("bob")], [], max_attempts=2)
    assert again.batch is not None
    assert [job.attempt for job in again.batch.jobs] == [2, 2]


def test_a_paused_batch_is_neither_claimed_nor_notified_for(store: Store) -> None:
    batch = _take(store, grading_request("ada"), grading_request("bob"))
    running = jobs.claim_job(store, "worker", 60)
    assert running is not None
    assert acting.pause(store, batch) == BatchControlResult(True, 1, 1)
    assert acting.pause(store, batch).changed is False
    assert jobs.claim_job(store, "worker", 60) is None
    assert JobQueue.BATCH not in count_missing_notices(store, 60)
    jobs.renew_lease(store, running, 60, 0.5)
    assert acting.resume(store, batch) == BatchControlResult(True, 1, 1)
    assert count_missing_notices(store, 60)[JobQueue.BATCH].stale == 1
    assert jobs.claim_job(store, "worker", 60) is not None


def test_a_cancelled_batch_ends_and_stays_so(store: Store) -> None:
    batch = _take(store, grading_request("ada"), grading_request("bob"), grading_request("eve"))
    dead = _die(store)
    running = jobs.claim_job(store, "worker", 60)
    assert running is not None
    assert acting.cancel(store, batch) == BatchControlResult(True, 1, 1)
    assert acting.cancel(store, batch).changed is False
    with pytest.raises(jobs.LeaseLost, match="cancelled"):
        jobs.renew_lease(store, running, 60, 0.5)
    for change in (acting.pause, acting.resume, acting.retry):
        with pytest.raises(UsageError, match="was cancelled; submit it again"):
            change(store, batch)
    assert acting.retry(store, None) == RetryCounts(0, 0)
    with store.reading() as session:
        line = batches.load_batch(session, batch)
        assert session.get_one(Job, dead).state is JobState.DEAD
    assert (line.state, line.states) == (BatchState.CANCELLED, {JobState.DEAD: 1, JobState.CANCELLED: 2})


def test_cancelling_what_has_ended_changes_nothing(store: Store) -> None:
    batch = _take(store, grading_request("ada"))
    _die(store)
    assert acting.cancel(store, batch).changed is False
    assert acting.retry(store, batch) == RetryCounts(1, 0)


def test_the_dead_are_tried_again_with_all_their_attempts_but_not_the_outdated(store: Store) -> None:
    batch = _take(store, grading_request("ada"), grading_request("bob"))
    dead = {_die(store), _die(store)}
    other = _take(store, grading_request("bob", OTHER))
    _die(store)
    assert acting.retry(store, batch) == RetryCounts(1, 1)
    assert acting.retry(store, None) == RetryCounts(1, 1)
    assert _states(store) == [(1, JobState.DEAD), (1, JobState.QUEUED), (2, JobState.QUEUED)]
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    with store.reading() as session:
        job = session.get_one(Job, claim.job_id)
        assert (job.attempt, job.error, job.finished_at) == (1, None, None)
        assert job.id in dead or job.batch_id == other
