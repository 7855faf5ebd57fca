"""Regrades after a change of an assignment or the grader: queues them, and reports changes and reasons.

Old grades are in effect until the new ones are published (``publishing.py``). Nothing is graded here.
``service.operations.regrades`` owns the transactions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from sqlalchemy import case, func, or_, select
from sqlalchemy.orm import Session, aliased

from service.store.batches import batches
from service.store.courses.assignment_versions import FrozenAssignment, store_version
from service.store.courses.hidden_names import HiddenNames
from service.store.engine import now
from service.store.grades import overrides
from service.store.grades.overrides import CriterionMarks
from service.store.models import AssignmentVersion, Batch, Enrolment, Job, SubmissionRow, TrialRow
from service.store.queue.jobs import enqueue
from service.store.states import UNFINISHED, JobQueue, JobState, Standing
from sim.errors import UsageError

_CHANGES_A_PAGE = 50
_UNEXPLAINED = "unexplained: other recordings from the same assignment and grader; robomark verify both"


@dataclass(frozen=True, slots=True)
class RegradeBatch:
    """A batch of regrades, with the number of submissions left out: other assignment, or not graded yet."""

    batch_id: str
    jobs: int
    other_assignment: int
    unfinished: int


@dataclass(frozen=True, slots=True)
class CriterionChange:
    """A criterion whose marks differ, as (marks, maximum); None if that version of the assignment does not have it.

    ``by_hand`` is true if marks set by staff replace those of the new grade; their maximum may differ.
    """

    title: str
    before: tuple[Decimal, Decimal] | None
    after: tuple[Decimal, Decimal] | None
    by_hand: bool


@dataclass(frozen=True, slots=True)
class Change:
    """A regrade and the grade that it may replace. Marks are None without a grade."""

    student: str
    job_id: str
    before_id: str
    state: JobState
    standing: Standing
    before: Decimal | None
    after: Decimal | None
    before_max: Decimal | None
    after_max: Decimal | None
    criteria: tuple[CriterionChange, ...]
    reason: str
    is_unexplained: bool  # different recordings, although their inputs are equal

    @property
    def differs(self) -> bool:
        """Return whether the regrade is done and its marks or maximum differ."""
        return self.state is JobState.DONE and (self.before, self.before_max) != (self.after, self.after_max)


@dataclass(frozen=True, slots=True)
class GradingLine:
    """One grading of a submission."""

    id: str
    state: JobState
    standing: Standing
    marks: Decimal | None
    max_marks: Decimal | None
    queued_at: datetime
    published_at: datetime | None


@dataclass(frozen=True, slots=True)
class ChangesPage:
    """A page of the changes of a batch, with the total and the number that differ or are not graded yet."""

    changes: tuple[Change, ...]
    found: int
    differing: int
    page: int
    pages: int


def queue_regrades(
    session: Session, original: Batch, frozen: FrozenAssignment | None, *, max_attempts: int
) -> RegradeBatch:
    """Queue a regrade of every submission of the batch that was graded or failed.

    Uses the assignment version ``frozen``, or else the version that each was graded against. Standing grades are not
    changed. Raises UsageError if there is nothing to grade again.
    """
    at = now(session)
    standing = _load_standing_jobs(session, original.id)
    ended = [row for row in standing if row[0].state in (JobState.DONE, JobState.DEAD)]
    wanted = [job for job, name in ended if frozen is None or name == frozen.assignment.id]
    unfinished = sum(job.state in UNFINISHED for job, _ in standing)
    if not wanted:
        raise UsageError(_describe_empty_regrade(original.id, frozen, {name for _, name in standing}, unfinished))
    version_id = None if frozen is None else store_version(session, frozen, at)
    batch = Batch(
        course_id=original.course_id,
        name=f"regrade of {original.name}",
        refusals=[],
        regrade_of=original.id,
        created_at=at,
    )
    session.add(batch)
    session.flush()
    for job in wanted:
        enqueue(session, _build_proposal(job, version_id, batch.id, JobQueue.BATCH, max_attempts), at)
    return RegradeBatch(batch.id, len(wanted), len(ended) - len(wanted), unfinished)


def queue_regrade(session: Session, asked: Job, frozen: FrozenAssignment | None, *, max_attempts: int) -> Job:
    """Queue an interactive regrade of one submission and return the new job.

    ``frozen`` as in ``regrade``. Raises UsageError if there is no grade yet, or for another assignment.
    """
    at = now(session)
    of_submission = (Job.submission_id == asked.submission_id, Job.standing == Standing.STANDS)
    standing = session.scalars(select(Job).where(*of_submission).order_by(Job.queued_at, Job.id)).all()
    ended = [job for job in standing if job.state in (JobState.DONE, JobState.DEAD)]
    if not ended:
        raise UsageError("this submission is not graded yet")
    name = session.get_one(AssignmentVersion, ended[-1].assignment_version_id).assignment
    if frozen is not None and frozen.assignment.id != name:
        raise UsageError(f"this submission is for {name}, not for {frozen.assignment.id}")
    version_id = None if frozen is None else store_version(session, frozen, at)
    proposal = _build_proposal(ended[-1], version_id, None, JobQueue.INTERACTIVE, max_attempts)
    enqueue(session, proposal, at)
    session.flush()
    return proposal


def load_change(session: Session, job_id: str) -> Change | None:
    """Return the change that a regrade makes; None if the job is not a regrade."""
    after = session.get(Job, job_id)
    if after is None or after.regrade_of is None:
        return None
    student = session.get_one(Enrolment, after.enrolment_id).student
    return _build_change(session, after, session.get_one(Job, after.regrade_of), student)


def load_gradings(session: Session, submission_id: int) -> list[GradingLine]:
    """Return all gradings of a submission, oldest first, without those of quarantined workers."""
    of_submission = (Job.submission_id == submission_id, Job.suspect.is_(None))
    rows = session.scalars(select(Job).where(*of_submission).order_by(Job.queued_at, Job.id))
    return [
        GradingLine(row.id, row.state, row.standing, row.marks, row.max_marks, row.queued_at, row.published_at)
        for row in rows
    ]


def load_changes(session: Session, batch_id: str, hidden: HiddenNames) -> list[Change]:
    """Return the changes of a batch of regrades, ordered by displayed student name."""
    before = aliased(Job)
    query = (
        select(Job, before, Enrolment.student, SubmissionRow.assignment)
        .join(before, Job.regrade_of == before.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(Job.batch_id == batch_id)
    )
    found = [
        _build_change(session, after, earlier, hidden.label_student(assignment, student))
        for after, earlier, student, assignment in session.execute(query)
    ]
    return sorted(found, key=lambda each: (each.student, each.job_id))


def load_changes_page(session: Session, batch_id: str, page: int, hidden: HiddenNames) -> ChangesPage:
    """Return a page of the changes of a batch of regrades: different marks first, then by student.

    If names are hidden, the order is that of the random job ids.
    """
    before = aliased(Job)
    differ = or_(Job.marks != before.marks, Job.max_marks != before.max_marks, Job.marks.is_(None))
    of_batch = (Job.batch_id == batch_id, Job.suspect.is_(None))
    joined = (
        select(func.count(), func.count(case((differ, 1)))).select_from(Job).join(before, Job.regrade_of == before.id)
    )
    found, differing = session.execute(joined.where(*of_batch)).one()
    page = min(max(page, 1), max(1, -(-found // _CHANGES_A_PAGE)))
    shown_order = case((SubmissionRow.assignment.in_(hidden.assignments), ""), else_=Enrolment.student)
    query = (
        select(Job, before, Enrolment.student, SubmissionRow.assignment)
        .join(before, Job.regrade_of == before.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(*of_batch)
        .order_by(case((differ, 0), else_=1), shown_order, Job.id)
        .limit(_CHANGES_A_PAGE)
        .offset((page - 1) * _CHANGES_A_PAGE)
    )
    shown = tuple(
        _build_change(session, after, earlier, hidden.label_student(assignment, student))
        for after, earlier, student, assignment in session.execute(query)
    )
    return ChangesPage(shown, found, differing, page, max(1, -(-found // _CHANGES_A_PAGE)))


def _load_standing_jobs(session: Session, batch_id: str) -> Sequence[tuple[Job, str]]:
    """Return the standing jobs of the submissions of a batch, with their assignments."""
    query = (
        select(Job, AssignmentVersion.assignment)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.submission_id.in_(batches.select_submissions(session, batch_id)), Job.standing == Standing.STANDS)
        .order_by(Job.queued_at, Job.id)
    )
    return [(job, name) for job, name in session.execute(query)]


def _describe_empty_regrade(batch_id: str, frozen: FrozenAssignment | None, found: set[str], unfinished: int) -> str:
    if frozen is not None and found and frozen.assignment.id not in found:
        return f"batch {batch_id} has no submission for {frozen.assignment.id}, only for {', '.join(sorted(found))}"
    waits = f": {unfinished} of its submissions are not graded yet" if unfinished else ""
    return f"batch {batch_id} has nothing to grade again{waits}"


def _build_proposal(job: Job, version_id: int | None, batch_id: str | None, lane: JobQueue, max_attempts: int) -> Job:
    return Job(
        submission_id=job.submission_id,
        assignment_version_id=version_id or job.assignment_version_id,
        enrolment_id=job.enrolment_id,
        batch_id=batch_id,
        lane=lane,
        max_attempts=max_attempts,
        forced=True,
        regrade_of=job.id,
        standing=Standing.PROPOSED,
    )


def _build_change(session: Session, after: Job, before: Job, student: str) -> Change:
    reason = _describe_reason(session, before, after)
    return Change(
        student=student,
        job_id=after.id,
        before_id=before.id,
        state=after.state,
        standing=after.standing,
        before=before.marks,
        after=after.marks,
        before_max=before.max_marks,
        after_max=after.max_marks,
        criteria=_compare_criteria(session, before.id, after.id) if after.state is JobState.DONE else (),
        reason=reason or _UNEXPLAINED,
        is_unexplained=reason is None,
    )


def _compare_criteria(session: Session, before_id: str, after_id: str) -> tuple[CriterionChange, ...]:
    before, after = _load_marks(session, before_id), _load_marks(session, after_id)
    changed = []
    for key, line in {**before, **after}.items():
        worths = _read_marks(before.get(key)), _read_marks(after.get(key))
        if worths[0] != worths[1]:
            changed.append(CriterionChange(line.title, *worths, by_hand=key in after and line.override is not None))
    return tuple(changed)


def _load_marks(session: Session, job_id: str) -> dict[str, CriterionMarks]:
    return {line.criterion: line for line in overrides.load_criterion_marks(session, job_id)}


def _read_marks(line: CriterionMarks | None) -> tuple[Decimal, Decimal] | None:
    return None if line is None else (line.marks, line.max_marks)


def _describe_reason(session: Session, before: Job, after: Job) -> str | None:
    """Return every difference between two gradings that may explain different marks; None without one."""
    if after.state is not JobState.DONE:
        return after.error or after.state.value
    reasons = []
    versions = [session.get_one(AssignmentVersion, job.assignment_version_id) for job in (before, after)]
    if versions[0].id != versions[1].id and versions[0].version != versions[1].version:
        reasons.append("assignment changed")
    if before.state is not JobState.DONE:
        reasons.append("had no grade")
    elif before.grader_sha256 is None or before.grader_sha256 != after.grader_sha256:
        versions_differ = before.grader_version != after.grader_version
        told = f" ({before.grader_version} to {after.grader_version})" if versions_differ else ""
        reasons.append(f"grader changed{told}")
    if before.state is JobState.DONE and before.secret_sha256 != after.secret_sha256:
        reasons.append("secret changed")
    if before.suspect is not None:
        reasons.append("the earlier worker was found to grade wrongly")
    if not reasons and _load_chains(session, before.id) != _load_chains(session, after.id):
        # The same grader and assignment must give the same recordings, so this needs review.
        return None
    return ", ".join(reasons) or "nothing changed"


def _load_chains(session: Session, job_id: str) -> list[str]:
    return list(session.scalars(select(TrialRow.sha256).where(TrialRow.job_id == job_id).order_by(TrialRow.position)))
