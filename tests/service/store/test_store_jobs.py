"""The states of a job: permitted transitions, the order of claims, and no double claims or lost jobs."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import func, select, update

import acting
import report_builders
from builders import accept_one, grading_request, prepared, settings_in
from command import FORKING
from service.operations.batches import BatchControlResult
from service.settings import Settings
from service.store.batches import batches, job_lines
from service.store.batches.intake import accept_batch
from service.store.engine import Store, open_store
from service.store.grades import plots
from service.store.queue import jobs
from service.store.queue.jobs import Claim, LeaseLost, RetryPolicy
from service.store.queue.lease_reaper import count_missing_notices, mark_notified, requeue_lost_jobs
from service.store.queue.scheduling import BATCH_JOB_INTERVAL
from service.store.states import BatchState, JobQueue, JobState, PlotState
from service.store.tables.courses import Course
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job, SubmissionRow
from submissions.student_identity import RejectedSubmission

NO_WAIT = RetryPolicy(0.0)


def _job(store: Store, job_id: str) -> Job:
    with store.reading() as session:
        return session.get_one(Job, job_id)


def _change(store: Store, job_id: str, **values: Any) -> None:
    with store.transaction() as session:
        session.execute(update(Job).where(Job.id == job_id).values(**values))


def _claim(store: Store, worker: str = "worker") -> Claim:
    claim = jobs.claim_job(store, worker, 60)
    assert claim is not None
    return claim


def _finish(store: Store, claim: Claim) -> None:
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))


def _rows(store: Store) -> tuple[int, int]:
    with store.reading() as session:
        count = [session.scalar(select(func.count()).select_from(table)) for table in (TrialRow, CriterionResultRow)]
    return count[0] or 0, count[1] or 0


def _lapse(store: Store, job_id: str) -> None:
    _change(store, job_id, lease_until=datetime.now(UTC) - timedelta(seconds=1))


def test_a_job_is_claimed_once_and_finished_once(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = _claim(store, "first")
    assert claim.job_id == job_id
    assert jobs.claim_job(store, "second", 60) is None
    _finish(store, claim)
    job = _job(store, job_id)
    assert (job.state, job.attempt, job.worker, job.lease, job.plots) == (
        JobState.DONE,
        1,
        "first",
        None,
        PlotState.DUE,
    )
    assert job.queued_at <= job.started_at <= job.graded_at <= job.finished_at  # type: ignore[operator]
    assert jobs.claim_job(store, "second", 60) is None


def test_a_stale_worker_can_change_nothing(store: Store) -> None:
    job_id = accept_one(store).job_id
    stale = _claim(store, "stale")
    _lapse(store, job_id)
    assert requeue_lost_jobs(store, NO_WAIT) == 1
    fresh = _claim(store, "fresh")
    for change in (
        lambda: jobs.renew_lease(store, stale, 60, 0.5),
        lambda: _finish(store, stale),
        lambda: jobs.fail_job(store, stale, "late", NO_WAIT),
        lambda: jobs.give_up_job(store, stale, "late"),
    ):
        with pytest.raises(LeaseLost):
            change()
    assert jobs.release_worker(store, "stale") == 0
    assert _rows(store) == (0, 0)
    assert (_job(store, job_id).state, _job(store, job_id).worker) == (JobState.RUNNING, "fresh")
    _finish(store, fresh)
    once = _rows(store)
    with pytest.raises(LeaseLost):
        _finish(store, stale)
    with pytest.raises(LeaseLost):
        _finish(store, fresh)
    assert _rows(store) == once
    assert _job(store, job_id).attempt == 2


def test_a_finish_that_fails_half_way_leaves_nothing(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    job_id = accept_one(store).job_id
    claim = _claim(store)

    def broken(*_: object) -> None:
        raise OSError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr("service.store.artifacts.store_files", broken)
        with pytest.raises(OSError, match="disk is full"):
            _finish(store, claim)
    assert _rows(store) == (0, 0)
    assert _job(store, job_id).state is JobState.RUNNING
    _finish(store, claim)
    assert _job(store, job_id).state is JobState.DONE


def test_a_heartbeat_keeps_the_lease_and_tells_the_progress(store: Store) -> None:
    job_id = accept_one(store).job_id
    claim = _claim(store)
    _lapse(store, job_id)
    jobs.renew_lease(store, claim, 60, 0.25)
    assert requeue_lost_jobs(store, NO_WAIT) == 0
    assert _job(store, job_id).progress == 0.25


def test_faults_of_ours_are_tried_again_later_and_not_for_ever(store: Store) -> None:
    job_id = accept_one(store, max_attempts=3).job_id
    retry = RetryPolicy(100.0)
    waits = []
    for attempt in (1, 2):
        before = datetime.now(UTC)
        assert jobs.fail_job(store, _claim(store), f"fault {attempt}", retry) is JobState.QUEUED
        assert jobs.claim_job(store, "eager", 60) is None
        waits.append((_job(store, job_id).due_at - before).total_seconds())
        _change(store, job_id, due_at=before)
    assert waits == [pytest.approx(100, abs=20), pytest.approx(200, abs=20)]
    assert jobs.fail_job(store, _claim(store), "fault 3", retry) is JobState.DEAD
    job = _job(store, job_id)
    assert job.error == "Tried 3 times, the last time: fault 3"
    assert job.finished_at is not None
    assert jobs.claim_job(store, "eager", 60) is None


def test_lost_workers_cost_attempts_and_end_with_a_reason(store: Store) -> None:
    job_id = accept_one(store, max_attempts=2).job_id
    for worker in ("one", "two"):
        _claim(store, worker)
        _lapse(store, job_id)
        assert requeue_lost_jobs(store, NO_WAIT) == 1
    job = _job(store, job_id)
    assert job.state is JobState.DEAD
    assert "the worker two stopped responding" in (job.error or "")
    assert requeue_lost_jobs(store, NO_WAIT) == 0


def test_what_is_given_back_costs_no_attempt(store: Store) -> None:
    job_id = accept_one(store, max_attempts=1).job_id
    _claim(store, "first")
    assert jobs.release_worker(store, "first") == 1
    assert (_job(store, job_id).state, _job(store, job_id).attempt) == (JobState.QUEUED, 0)
    claim = _claim(store, "ended")
    assert jobs.release_worker(store, "another") == 0
    assert jobs.release_worker(store, "ended") == 1
    with pytest.raises(LeaseLost):
        _finish(store, claim)
    _finish(store, _claim(store))
    assert _job(store, job_id).attempt == 1


def test_a_cancelled_job_stops_its_worker(store: Store) -> None:
    batch = _batch(store, "batch", 2)
    claim = _claim(store)
    assert acting.cancel(store, batch) == BatchControlResult(True, 1, 1)
    with pytest.raises(LeaseLost, match="cancelled"):
        jobs.renew_lease(store, claim, 60, 0.5)
    assert jobs.claim_job(store, "worker", 60) is None
    assert not acting.cancel(store, batch).changed


def test_the_newest_submission_supersedes_one_that_waits_not_one_that_runs(store: Store) -> None:
    first = accept_one(store).job_id
    claim = _claim(store)
    second, third = accept_one(store).job_id, accept_one(store).job_id
    states = [_job(store, job_id).state for job_id in (first, second, third)]
    assert states == [JobState.RUNNING, JobState.CANCELLED, JobState.QUEUED]
    assert _job(store, second).error == f"superseded by {third}"
    _finish(store, claim)
    with store.reading() as session:
        assert session.scalars(select(SubmissionRow.attempt).order_by(SubmissionRow.id)).all() == [1, 2, 3]


def _batch(store: Store, name: str, count: int) -> str:
    grading_requests = [grading_request(f"{name}-{number}") for number in range(count)]
    return accept_batch(store, name, grading_requests, [RejectedSubmission("odd.txt", "is odd.")], max_attempts=3).id


def _served(store: Store, count: int) -> list[str | None]:
    """Return the batches of the next jobs that a single worker claims."""
    served = []
    for _ in range(count):
        claim = _claim(store)
        served.append(_job(store, claim.job_id).batch_id)
        _finish(store, claim)
    return served


def test_batches_share_one_worker(store: Store) -> None:
    large = _batch(store, "large", 8)
    small = _batch(store, "small", 3)
    assert Counter(_served(store, 6)) == {large: 3, small: 3}
    assert _served(store, 5) == [large] * 5


def test_people_come_before_batches_but_not_for_ever(store: Store) -> None:
    batch = _batch(store, "batch", 3)
    for number in range(2 * BATCH_JOB_INTERVAL):
        accept_one(store, f"person-{number}")
    served = _served(store, 2 * BATCH_JOB_INTERVAL)
    assert served[0] is None
    assert served.count(batch) == 2


def test_one_student_does_not_hold_up_the_others(store: Store) -> None:
    accept_one(store, "keen")
    _finish(store, _claim(store))
    again = accept_one(store, "keen").job_id
    other = accept_one(store, "other").job_id
    assert [_claim(store).job_id, _claim(store).job_id] == [other, again]


def test_one_student_does_not_hold_up_the_others_in_another_batch(store: Store) -> None:
    begun, older, newer = (
        accept_batch(store, name, [grading_request(student, f"print('{name}')\n")], (), max_attempts=3).jobs[0].job_id
        for name, student in (("begun", "keen"), ("older", "keen again"), ("newer", "other"))
    )
    with store.transaction() as session:
        keen = session.get_one(Job, begun).enrolment_id
        session.execute(update(Job).where(Job.id == older).values(enrolment_id=keen))
    assert [_claim(store).job_id for _ in range(3)] == [begun, newer, older]


def test_jobs_with_and_without_a_batch_are_compared_if_all_their_students_were_served(store: Store) -> None:
    accept_batch(store, "first", [grading_request("ada"), grading_request("bob")], (), max_attempts=3)
    _claim(store)
    _claim(store)
    in_batch = accept_batch(store, "second", [grading_request("ada", "print(2)\n")], (), max_attempts=3).jobs[0].job_id
    alone = accept_one(store, "bob", lane=JobQueue.BATCH).job_id
    assert [_claim(store).job_id for _ in range(2)] == [in_batch, alone]


def test_starts_from_before_the_clock_was_set_back_are_no_share(store: Store) -> None:
    ended = accept_batch(store, "ended", [grading_request("ada")], (), max_attempts=3)
    claim = _claim(store)
    _finish(store, claim)
    _change(store, claim.job_id, started_at=datetime.now(UTC) + timedelta(hours=1))
    older, newer = accept_one(store, "ada").job_id, accept_one(store, "bob").job_id
    assert claim.job_id == ended.jobs[0].job_id
    assert [_claim(store).job_id for _ in range(2)] == [older, newer]


def test_a_paused_batch_waits(store: Store) -> None:
    batch = _batch(store, "batch", 1)
    with store.transaction() as session:
        session.execute(update(Batch).values(state=BatchState.PAUSED))
    assert jobs.claim_job(store, "worker", 60) is None
    with store.transaction() as session:
        session.execute(update(Batch).values(state=BatchState.OPEN))
    assert _job(store, _claim(store).job_id).batch_id == batch


def test_a_batch_knows_how_far_it_is(store: Store) -> None:
    batch = _batch(store, "batch", 3)
    _finish(store, _claim(store))
    jobs.renew_lease(store, _claim(store), 60, 0.5)
    with store.reading() as session:
        progress = batches.load_progress(session, batch)
        line = batches.load_batch(session, batches.find_batch(session, batch[:8]))
        lines = job_lines.load_job_lines(session, batch)
    assert (progress.jobs, progress.ended, progress.partial, progress.plots_due) == (3, 1, 0.5, 1)
    assert line.states == {JobState.DONE: 1, JobState.RUNNING: 1, JobState.QUEUED: 1}
    assert line.refusals == (RejectedSubmission("odd.txt", "is odd."),)
    assert [(line.student, line.ended) for line in lines].count(("batch-0", True)) <= 1
    assert sum(line.ended for line in lines) == 1


def test_notices_are_wanting_until_they_are_noted(store: Store) -> None:
    _batch(store, "batch", 3)
    assert (
        count_missing_notices(store, 60)[JobQueue.BATCH].due,
        count_missing_notices(store, 60)[JobQueue.BATCH].stale,
    ) == (3, 3)
    mark_notified(store, JobQueue.BATCH, 2)
    assert (
        count_missing_notices(store, 60)[JobQueue.BATCH].due,
        count_missing_notices(store, 60)[JobQueue.BATCH].stale,
    ) == (3, 1)
    assert count_missing_notices(store, 0)[JobQueue.BATCH].stale == 3
    _claim(store)
    assert count_missing_notices(store, 60)[JobQueue.BATCH].due == 2


def test_plots_are_tried_a_few_times(store: Store) -> None:
    job_id = accept_one(store).job_id
    assert plots.claim_plots(store, 60) is None
    _finish(store, _claim(store))
    for _ in range(plots.MAX_ATTEMPTS):
        assert plots.claim_plots(store, 60) == job_id
        assert plots.claim_plots(store, 60) is None
        _change(store, job_id, plots_due_at=datetime.now(UTC))
    assert plots.claim_plots(store, 60) is None
    assert _job(store, job_id).plots is PlotState.FAILED


def _race(settings: Settings, number: int, counts: Any) -> None:
    claimed = []
    with open_store(settings) as store:
        while (claim := jobs.claim_job(store, f"racer-{number}", 60)) is not None:
            claimed.append(claim.job_id)
            jobs.give_up_job(store, claim, "raced")
    counts.put(claimed)


@pytest.mark.long
def test_four_processes_claim_no_job_twice(service_settings: Settings) -> None:
    with open_store(service_settings) as store:
        _batch(store, "race", 60)
    counts = FORKING.Queue()
    racers = [FORKING.Process(target=_race, args=(service_settings, number, counts)) for number in range(4)]
    for racer in racers:
        racer.start()
    claimed = [job_id for _ in racers for job_id in counts.get(timeout=120)]
    for racer in racers:
        racer.join()
        racer.close()
    counts.close()
    counts.join_thread()
    assert len(claimed) == len(set(claimed)) == 60
    with open_store(service_settings) as store, store.reading() as session:
        assert session.scalars(select(Job.attempt).distinct()).all() == [1]


@pytest.mark.long
def test_two_batches_at_once_number_attempts_one_by_one(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    open_store(settings).close()
    submitters = [FORKING.Process(target=_submit_again, args=(settings,)) for _ in range(3)]
    for submitter in submitters:
        submitter.start()
    for submitter in submitters:
        submitter.join()
        assert submitter.exitcode == 0
        submitter.close()
    with open_store(settings) as store, store.reading() as session:
        assert session.scalars(select(SubmissionRow.attempt).order_by(SubmissionRow.attempt)).all() == list(
            range(1, 16)
        )
        queued = select(func.count()).select_from(Job).where(Job.state == JobState.QUEUED)
        assert session.scalar(queued) == 1


def _submit_again(settings: Settings) -> None:
    with open_store(settings) as store:
        for _ in range(5):
            accept_one(store)


@pytest.mark.long
def test_courses_share_alike_however_many_batches_they_have(store: Store) -> None:
    """A submits eight batches of 30, B and C one each. B and C have all grades after about 90 grades in total."""
    for course, count in (("A", 8), ("B", 1), ("C", 1)):
        for number in range(count):
            requests = [grading_request(f"{course}{number}-{place}") for place in range(30)]
            accept_batch(store, f"{course}{number}", requests, (), course=course, max_attempts=3)
    begun: Counter[str] = Counter()
    ended_at: dict[str, int] = {}
    for turn in range(1, 121):
        claim = jobs.claim_job(store, "worker", 600)
        assert claim is not None
        with store.reading() as session:
            enrolment = session.get_one(Enrolment, session.get_one(Job, claim.job_id).enrolment_id)
            begun[session.get_one(Course, enrolment.course_id).name] += 1
        for course in ("B", "C"):
            if begun[course] == 30:
                ended_at.setdefault(course, turn)
    assert all(ended_at[course] <= 92 for course in ("B", "C")), ended_at
