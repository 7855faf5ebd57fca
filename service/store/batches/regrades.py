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
from service.store.queue.jobs import enqueue
from service.store.states import UNFINISHED, JobQueue, JobState, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job, SubmissionRow
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
    session: Session, original: Batch, frozen_assignment: FrozenAssignment | None, *, max_attempts: int
) -> RegradeBatch:
    """Queue a regrade of every submission of the batch that was graded or failed.

    Uses the assignment version ``frozen_assignment``, or else the version that each was graded against. Standing grades
    are not changed. Raises UsageError if there is nothing to grade again.
    """
    current_time = now(session)
    standing_jobs = _load_standing_jobs(session, original.id)
    ended_jobs = [row for row in standing_jobs if row[0].state in (JobState.DONE, JobState.DEAD)]
    selected_jobs = [
        job for job, name in ended_jobs if frozen_assignment is None or name == frozen_assignment.assignment.id
    ]
    unfinished_count = sum(job.state in UNFINISHED for job, _ in standing_jobs)
    if not selected_jobs:
        raise UsageError(
            _describe_empty_regrade(
                original.id, frozen_assignment, {name for _, name in standing_jobs}, unfinished_count
            )
        )
    version_id = None if frozen_assignment is None else store_version(session, frozen_assignment, current_time)
    batch = Batch(
        course_id=original.course_id,
        name=f"regrade of {original.name}",
        refusals=[],
        regrade_of=original.id,
        created_at=current_time,
    )
    session.add(batch)
    session.flush()
    for job in selected_jobs:
        enqueue(session, _build_proposal(job, version_id, batch.id, JobQueue.BATCH, max_attempts), current_time)
    return RegradeBatch(batch.id, len(selected_jobs), len(ended_jobs) - len(selected_jobs), unfinished_count)


def queue_regrade(
    session: Session, requested_job: Job, frozen_assignment: FrozenAssignment | None, *, max_attempts: int
) -> Job:
    """Queue an interactive regrade of one submission and return the new job.

    ``frozen_assignment`` as in ``regrade``. Raises UsageError if there is no grade yet, or for another assignment.
    """
    current_time = now(session)
    is_standing = (Job.submission_id == requested_job.submission_id, Job.standing == Standing.STANDS)
    standing_jobs = session.scalars(select(Job).where(*is_standing).order_by(Job.queued_at, Job.id)).all()
    ended_jobs = [job for job in standing_jobs if job.state in (JobState.DONE, JobState.DEAD)]
    if not ended_jobs:
        raise UsageError("this submission is not graded yet")
    name = session.get_one(AssignmentVersion, ended_jobs[-1].assignment_version_id).assignment
    if frozen_assignment is not None and frozen_assignment.assignment.id != name:
        raise UsageError(f"this submission is for {name}, not for {frozen_assignment.assignment.id}")
    version_id = None if frozen_assignment is None else store_version(session, frozen_assignment, current_time)
    proposal = _build_proposal(ended_jobs[-1], version_id, None, JobQueue.INTERACTIVE, max_attempts)
    enqueue(session, proposal, current_time)
    session.flush()
    return proposal


def load_change(session: Session, job_id: str) -> Change | None:
    """Return the change that a regrade makes; None if the job is not a regrade."""
    regrade = session.get(Job, job_id)
    if regrade is None or regrade.regrade_of is None:
        return None
    student = session.get_one(Enrolment, regrade.enrolment_id).student
    return _build_change(session, regrade, session.get_one(Job, regrade.regrade_of), student)


def load_gradings(session: Session, submission_id: int) -> list[GradingLine]:
    """Return all gradings of a submission, oldest first, without those of quarantined workers."""
    is_grading = (Job.submission_id == submission_id, Job.suspect.is_(None))
    rows = session.scalars(select(Job).where(*is_grading).order_by(Job.queued_at, Job.id))
    return [
        GradingLine(row.id, row.state, row.standing, row.marks, row.max_marks, row.queued_at, row.published_at)
        for row in rows
    ]


def load_changes(session: Session, batch_id: str, hidden_names: HiddenNames) -> list[Change]:
    """Return the changes of a batch of regrades, ordered by displayed student name."""
    original_job = aliased(Job)
    query = (
        select(Job, original_job, Enrolment.student, SubmissionRow.assignment)
        .join(original_job, Job.regrade_of == original_job.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(Job.batch_id == batch_id)
    )
    changes = [
        _build_change(session, after, earlier, hidden_names.label_student(assignment, student))
        for after, earlier, student, assignment in session.execute(query)
    ]
    return sorted(changes, key=lambda each: (each.student, each.job_id))


def load_changes_page(session: Session, batch_id: str, page: int, hidden_names: HiddenNames) -> ChangesPage:
    """Return a page of the changes of a batch of regrades: different marks first, then by student.

    If names are hidden, the order is that of the random job ids.
    """
    original_job = aliased(Job)
    is_different = or_(Job.marks != original_job.marks, Job.max_marks != original_job.max_marks, Job.marks.is_(None))
    is_in_batch = (Job.batch_id == batch_id, Job.suspect.is_(None))
    count_query = (
        select(func.count(), func.count(case((is_different, 1))))
        .select_from(Job)
        .join(original_job, Job.regrade_of == original_job.id)
    )
    change_count, different_count = session.execute(count_query.where(*is_in_batch)).one()
    page = min(max(page, 1), max(1, -(-change_count // _CHANGES_A_PAGE)))
    name_order = case((SubmissionRow.assignment.in_(hidden_names.assignments), ""), else_=Enrolment.student)
    query = (
        select(Job, original_job, Enrolment.student, SubmissionRow.assignment)
        .join(original_job, Job.regrade_of == original_job.id)
        .join(Enrolment, Job.enrolment_id == Enrolment.id)
        .join(SubmissionRow, Job.submission_id == SubmissionRow.id)
        .where(*is_in_batch)
        .order_by(case((is_different, 0), else_=1), name_order, Job.id)
        .limit(_CHANGES_A_PAGE)
        .offset((page - 1) * _CHANGES_A_PAGE)
    )
    changes = tuple(
        _build_change(session, after, earlier, hidden_names.label_student(assignment, student))
        for after, earlier, student, assignment in session.execute(query)
    )
    return ChangesPage(changes, change_count, different_count, page, max(1, -(-change_count // _CHANGES_A_PAGE)))


def _load_standing_jobs(session: Session, batch_id: str) -> Sequence[tuple[Job, str]]:
    """Return the standing jobs of the submissions of a batch, with their assignments."""
    query = (
        select(Job, AssignmentVersion.assignment)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.submission_id.in_(batches.select_submissions(session, batch_id)), Job.standing == Standing.STANDS)
        .order_by(Job.queued_at, Job.id)
    )
    return [(job, name) for job, name in session.execute(query)]


def _describe_empty_regrade(
    batch_id: str, frozen_assignment: FrozenAssignment | None, assignment_names: set[str], unfinished_count: int
) -> str:
    if frozen_assignment is not None and assignment_names and frozen_assignment.assignment.id not in assignment_names:
        return (
            f"batch {batch_id} has no submission for {frozen_assignment.assignment.id}, only for "
            f"{', '.join(sorted(assignment_names))}"
        )
    unfinished_note = f": {unfinished_count} of its submissions are not graded yet" if unfinished_count else ""
    return f"batch {batch_id} has nothing to grade again{unfinished_note}"


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


def _build_change(session: Session, regrade: Job, original: Job, student: str) -> Change:
    reason = _describe_reason(session, original, regrade)
    return Change(
        student=student,
        job_id=regrade.id,
        before_id=original.id,
        state=regrade.state,
        standing=regrade.standing,
        before=original.marks,
        after=regrade.marks,
        before_max=original.max_marks,
        after_max=regrade.max_marks,
        criteria=_compare_criteria(session, original.id, regrade.id) if regrade.state is JobState.DONE else (),
        reason=reason or _UNEXPLAINED,
        is_unexplained=reason is None,
    )


def _compare_criteria(session: Session, original_id: str, regrade_id: str) -> tuple[CriterionChange, ...]:
    original_marks, regrade_marks = _load_marks(session, original_id), _load_marks(session, regrade_id)
    criterion_changes = []
    for key, line in {**original_marks, **regrade_marks}.items():
        marks_pair = _read_marks(original_marks.get(key)), _read_marks(regrade_marks.get(key))
        if marks_pair[0] != marks_pair[1]:
            criterion_changes.append(
                CriterionChange(line.title, *marks_pair, by_hand=key in regrade_marks and line.override is not None)
            )
    return tuple(criterion_changes)


def _load_marks(session: Session, job_id: str) -> dict[str, CriterionMarks]:
    return {line.criterion: line for line in overrides.load_criterion_marks(session, job_id)}


def _read_marks(line: CriterionMarks | None) -> tuple[Decimal, Decimal] | None:
    return None if line is None else (line.marks, line.max_marks)


def _describe_reason(session: Session, original: Job, regrade: Job) -> str | None:
    """Return every difference between two gradings that may explain different marks; None without one."""
    if regrade.state is not JobState.DONE:
        return regrade.error or regrade.state.value
    reasons = []
    versions = [session.get_one(AssignmentVersion, job.assignment_version_id) for job in (original, regrade)]
    if versions[0].id != versions[1].id and versions[0].version != versions[1].version:
        reasons.append("assignment changed")
    if original.state is not JobState.DONE:
        reasons.append("had no grade")
    elif original.grader_sha256 is None or original.grader_sha256 != regrade.grader_sha256:
        versions_differ = original.grader_version != regrade.grader_version
        version_note = f" ({original.grader_version} to {regrade.grader_version})" if versions_differ else ""
        reasons.append(f"grader changed{version_note}")
    if original.state is JobState.DONE and original.secret_sha256 != regrade.secret_sha256:
        reasons.append("secret changed")
    if original.suspect is not None:
        reasons.append("the earlier worker was found to grade wrongly")
    if not reasons and _load_chains(session, original.id) != _load_chains(session, regrade.id):
        # The same grader and assignment must give the same recordings, so this needs review.
        return None
    return ", ".join(reasons) or "nothing changed"


def _load_chains(session: Session, job_id: str) -> list[str]:
    return list(session.scalars(select(TrialRow.sha256).where(TrialRow.job_id == job_id).order_by(TrialRow.position)))
