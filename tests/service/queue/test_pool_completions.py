"""Provisional grades: completed by idle workers or on request, and published only on purpose."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest
from sqlalchemy import select, update

from acting import Notices, machine, service_on
from builders import grading_request, settings_in
from pools import ASSIGNMENT, LUCKY, pool_assignment, pool_request
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.operations import appeals, policies, regrades
from service.operations.context import Actor
from service.queue.grading_job import GradingOutcome, grade_next_job
from service.settings import Settings
from service.store import audit
from service.store.batches.intake import AcceptedSubmission, accept_submission
from service.store.engine import Store, now
from service.store.grades import results
from service.store.installation import load_secret
from service.store.people import webhooks
from service.store.queue import jobs, pool_progress
from service.store.states import CompletionRule, JobQueue, JobState, Role, Standing
from service.store.tables.courses import Delivery
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.limits import Limits
from submissions.grading_request import GradingRequest


@pytest.fixture
def assignment(tmp_path: Path) -> Assignment:
    return pool_assignment(tmp_path / "short-pool")


def submitted(store: Store, request: GradingRequest) -> AcceptedSubmission:
    return accept_submission(store, request, lane=JobQueue.INTERACTIVE, max_attempts=3)


def graded(store: Store, settings: Settings, runner: TrialRunner, count: int = 1) -> None:
    for _ in range(count):
        assert grade_next_job(store, settings, runner, "worker") is GradingOutcome.GRADED


def standing(store: Store, submission_id: int) -> Job:
    with store.reading() as session:
        query = select(Job).where(Job.submission_id == submission_id, Job.standing == Standing.STANDS)
        return session.scalars(query).one()


def set_marks(store: Store, job_id: str, marks: str) -> None:
    with store.transaction() as session:
        session.execute(update(Job).where(Job.id == job_id).values(marks=Decimal(marks)))


@pytest.mark.long
def test_a_provisional_grade_is_completed_and_replaced(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    accepted = submitted(store, pool_request(assignment))
    graded(store, service_settings, runner)
    first = standing(store, accepted.submission_id)
    assert (first.id, first.provisional) == (accepted.job_id, True)
    with store.reading() as session:
        provisional = results.load_grade(session, first.id)
        completion = session.scalars(select(Job).where(Job.regrade_of == first.id)).one()
    assert 2 <= len(provisional.trials) <= 6
    assert (completion.lane, completion.state, completion.whole_pools) == (JobQueue.COMPLETION, JobState.QUEUED, True)
    graded(store, service_settings, runner)
    exact = standing(store, accepted.submission_id)
    assert (exact.id, exact.provisional) == (completion.id, False)
    with store.reading() as session:
        grade_of_pool = results.load_grade(session, exact.id)
    expected = grade(pool_request(assignment).submission, assignment, secret=load_secret(store), runner=runner)
    assert len(grade_of_pool.trials) == 30
    assert grade_of_pool.marks == expected.marks
    assert [each.recording.sha256 for each in grade_of_pool.trials[: len(provisional.trials)]] == [
        each.recording.sha256 for each in provisional.trials
    ]
    pool = grade_of_pool.criteria[0].pool
    assert pool is not None
    assert (pool.size, pool.drawn, pool.least) == (30, 30, pool.most)
    assert grade_next_job(store, service_settings, runner, "worker") is not GradingOutcome.GRADED


def test_everything_else_is_graded_before_a_completion(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    submitted(store, pool_request(assignment))
    graded(store, service_settings, runner)
    late = accept_submission(store, grading_request("bob"), lane=JobQueue.BATCH, max_attempts=3)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    assert claim.job_id == late.job_id


def test_only_exact_grades_are_published_unless_asked(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    accepted = submitted(store, pool_request(assignment))
    graded(store, service_settings, runner)
    service, staff = service_on(store), machine()
    counts = regrades.publish_one(service, staff, 1, accepted.job_id)
    assert (counts.published, counts.provisional) == (0, 1)
    graded(store, service_settings, runner)
    counts = regrades.publish_one(service, staff, 1, accepted.job_id)
    assert (counts.published, counts.provisional) == (1, 0)
    assert standing(store, accepted.submission_id).published_at is not None


@pytest.mark.long
@pytest.mark.parametrize(
    ("rule", "published_marks", "is_replaced"),
    [
        (CompletionRule.HIGHER, "0", True),
        (CompletionRule.HIGHER, "99", False),
        (CompletionRule.EXACT, "0", True),
        (CompletionRule.EXACT, "99", True),
    ],
)
def test_completion_lowers_published_marks_only_if_the_course_says_so(
    store: Store,
    service_settings: Settings,
    runner: TrialRunner,
    assignment: Assignment,
    rule: CompletionRule,
    published_marks: str,
    is_replaced: bool,
) -> None:
    accepted = submitted(store, pool_request(assignment))
    graded(store, service_settings, runner)
    counts = regrades.publish_one(service_on(store), machine("grace"), 1, accepted.job_id, includes_held_back=True)
    assert counts.published == 1
    policies.set_completion_rule(service_on(store), machine("grace"), 1, rule)
    with store.transaction() as session:
        webhooks.create_webhook(session, 1, "https://hooks.example.org/x", ["grades.published"])
    set_marks(store, accepted.job_id, published_marks)
    with store.reading() as session:
        before = pool_progress.load_progress(session, accepted.submission_id)
    assert before is not None
    assert before.can_decrease is (rule is CompletionRule.EXACT)
    graded(store, service_settings, runner)
    now_standing = standing(store, accepted.submission_id)
    assert (now_standing.id != accepted.job_id) is is_replaced
    assert (now_standing.published_by, now_standing.published_at is not None) == ("grace", True)
    with store.reading() as session:
        payloads = [row.payload["data"] for row in session.scalars(select(Delivery))]
        entries = audit.load_entries(session, "job", now_standing.id)
    assert payloads == ([{"grade": now_standing.id, "published": 1}] if is_replaced else [])
    assert ("publish exact" in [each.action for each in entries]) is is_replaced
    with store.reading() as session:
        progress = pool_progress.load_progress(session, accepted.submission_id)
    assert (progress is not None) is is_replaced
    refusal = "exact already" if is_replaced else "your published marks stay"
    with store.transaction() as session, pytest.raises(UsageError, match=refusal):
        pool_progress.expedite(session, accepted.submission_id, now_standing.enrolment_id, now(session))


@pytest.mark.parametrize("limits", [Limits(), Limits(program_cpu=120, responder_cpu=120)])
def test_the_processor_time_of_the_largest_assignment_fits_into_the_time_of_a_job(
    tmp_path: Path, limits: Limits
) -> None:
    assert limits.compute_total_cpu(5000) * 1.4 < settings_in(tmp_path).job_seconds


def test_a_student_has_all_trials_run_once_at_a_time(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    first = submitted(store, pool_request(assignment))
    graded(store, service_settings, runner)
    with store.reading() as session:
        person_id = session.scalars(select(Enrolment.person_id)).one()
    service, notices = service_on(store), Notices()
    service = replace(service, notifier=notices)
    ada = Actor("ada", person_id=person_id, roles={1: Role.STUDENT})
    before = appeals.show_own(service, ada, 1, first.submission_id).pool
    assert before is not None
    assert (before.is_exact, before.is_expedited, before.seconds) == (False, False, 60)
    appeals.run_all_trials(service, ada, 1, first.submission_id)
    assert notices.sent == [("interactive", 1)]
    with pytest.raises(UsageError, match="wait for the result"):
        appeals.run_all_trials(service, ada, 1, first.submission_id)
    during = appeals.show_own(service, ada, 1, first.submission_id).pool
    assert during is not None
    assert during.is_expedited
    graded(store, service_settings, runner)
    after = appeals.show_own(service, ada, 1, first.submission_id).pool
    assert after is not None
    assert after.is_exact
    with pytest.raises(UsageError, match="exact already"):
        appeals.run_all_trials(service, ada, 1, first.submission_id)


def test_a_student_learns_no_exact_processor_time_of_hidden_trials(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    accepted = submitted(store, pool_request(assignment))
    graded(store, service_settings, runner)
    estimates = set()
    for seconds in (0.1, 0.9, 1.7):
        with store.transaction() as session:
            job = session.get_one(Job, accepted.job_id)
            job.cost = {**job.cost, "spent": {"cpu_seconds": seconds}} if job.cost else None
            progress = pool_progress.load_progress(session, accepted.submission_id)
            assert progress is not None
            estimates.add(progress.seconds)
    assert estimates == {60}


@pytest.mark.long
def test_a_copy_of_a_provisional_grade_is_completed_too(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    submitted(store, pool_request(assignment))
    graded(store, service_settings, runner, 2)
    again = submitted(store, pool_request(assignment, "bob"))
    while grade_next_job(store, service_settings, runner, "worker") is GradingOutcome.GRADED:
        pass
    with store.reading() as session:
        query = select(Job).where(Job.submission_id == again.submission_id).order_by(Job.queued_at)
        copied, exact = session.scalars(query).all()
    assert (copied.provisional, copied.standing, copied.copied_from is not None) == (True, Standing.KEPT, True)
    assert (exact.provisional, exact.standing, exact.copied_from is not None) == (False, Standing.STANDS, True)


@pytest.mark.long
def test_white_space_gains_nothing(
    store: Store, service_settings: Settings, runner: TrialRunner, assignment: Assignment
) -> None:
    hashes = set()
    for blanks in range(3):
        accepted = submitted(store, pool_request(assignment, f"student{blanks}", LUCKY + "\n" * blanks))
        graded(store, service_settings, runner)
        with store.reading() as session:
            trials = results.load_grade(session, accepted.job_id).trials
        hashes.add(tuple(each.recording.sha256 for each in trials))
    assert len(hashes) == 1


def test_marks_over_hidden_trials_reveal_no_exact_share(tmp_path: Path, runner: TrialRunner) -> None:
    without_bands = ASSIGNMENT.replace("bands = [[0.5, 2], [0.7, 4]]\n", "")
    assignment = pool_assignment(tmp_path / "short-pool", without_bands)
    (result,) = grade(pool_request(assignment).submission, assignment, runner=runner).criteria
    assert result.pool is not None
    assert float(result.marks) == pytest.approx(4 * round(result.pool.least * 20) / 20)
    assert result.pool.least * 30 == pytest.approx(round(result.pool.least * 30))
