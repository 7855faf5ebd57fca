"""Scheduling: the next job by queue, by fair share of course, batch and student, and by age.

Only chooses; ``jobs.claim_job`` takes the job, in the statement that chooses it. The cost of a claim depends on the
number of batches with waiting jobs, not on the number of these jobs: each step reads the start of an index. The
statements are built once, because building one takes longer than running it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from itertools import groupby
from typing import Any

from sqlalchemy import (
    ColumnElement,
    DateTime,
    Interval,
    Select,
    and_,
    bindparam,
    case,
    func,
    literal_column,
    not_,
    null,
    or_,
    select,
    true,
    union_all,
)
from sqlalchemy.engine import Connection
from sqlalchemy.sql.selectable import CTE

from service.store.queue.workers import ALIVE_PERIOD, match_other_live_worker
from service.store.revision import is_newer_than_code, select_oldest_compatible
from service.store.states import BatchState, JobQueue, JobState
from service.store.tables.installation import Worker
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job

#: Shares count only jobs started within this time, so earlier use is no disadvantage.
SHARE_WINDOW = timedelta(seconds=60)
#: Shares count at most this number of jobs, the last ones, so that counting takes the same time at any load.
MAX_SHARE_JOBS = 250
#: One in this number of started jobs is from a batch, even if interactive jobs wait.
BATCH_JOB_INTERVAL = 5
#: Time for which a job that failed on one worker is reserved for the other workers.
RESERVED_PERIOD = timedelta(seconds=20)

_JOB, _BATCH, _ENROLMENT, _WORKER = (table.__table__ for table in (Job, Batch, Enrolment, Worker))
# Written into the statement: with a parameter instead, no database would use an index of queued jobs only.
_IS_QUEUED: ColumnElement[bool] = literal_column(f"job.state = '{JobState.QUEUED.value}'")
# Other constants, too: PostgreSQL plans a statement again each time if its parameters could change the plan.
_QUEUES: tuple[ColumnElement[Any], ...] = tuple(
    literal_column(f"'{lane.value}'", _JOB.c.lane.type) for lane in JobQueue
)
_IS_OPEN: ColumnElement[bool] = _BATCH.c.state == literal_column(f"'{BatchState.OPEN.value}'")
_ZERO: ColumnElement[int] = literal_column("0")
_ONE: ColumnElement[int] = literal_column("1")


@dataclass(frozen=True, slots=True)
class _Group:
    """The waiting jobs of one queue, course and batch, or of a course without a batch."""

    lane: JobQueue
    course_id: int
    batch_id: str | None


def match_claimable_jobs(current_time: datetime) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions for a claimable job: it is queued and due, and its batch is open."""
    closed_batches = select(Batch.id).where(Batch.state != BatchState.OPEN)
    return (
        Job.state == JobState.QUEUED,
        Job.due_at <= current_time,
        or_(Job.batch_id.is_(None), Job.batch_id.not_in(closed_batches)),
    )


def select_recent_jobs(
    since: datetime | ColumnElement[datetime], until: datetime | ColumnElement[datetime]
) -> Select[JobQueue, str | None, int]:
    """Return a query for the queue, batch and student of every job that counts towards a share.

    ``until`` leaves out jobs that were started before the clock was set back, which would take the places of others.
    """
    return (
        select(_JOB.c.lane, _JOB.c.batch_id, _JOB.c.enrolment_id)
        .where(_JOB.c.started_at > since, _JOB.c.started_at < until)
        .order_by(_JOB.c.started_at.desc())
        .limit(literal_column(str(MAX_SHARE_JOBS)))
    )


@dataclass(frozen=True, slots=True)
class Choice:
    """A query whose row ends with the id of a job to claim, with its parameters. Without a row, the next one counts.

    On PostgreSQL, the query locks the row of the job. ``query`` is always one of a few objects.
    """

    query: Select[Any]
    parameters: Mapping[str, object]


def find_choices(connection: Connection, worker: str) -> tuple[datetime, Iterator[Choice]] | None:
    """Return the database's clock and the choices of ``worker``'s next job, in order.

    None if the worker is in quarantine or its code is too old for the tables. Interactive jobs come first, except for
    one job in five, and completions of pools last. Within a queue, the course with the fewest recently started jobs
    comes first, then the batch, then the student, then the oldest job.
    """
    clock = datetime.now(UTC)  # SQLite has none
    rows = connection.execute(
        _build_turn_query(connection.dialect.name), {"claimant": worker, **_compute_share_limits(clock)}
    ).all()
    database_clock, oldest_compatible, quarantined_at, *_ = rows[0]
    if is_newer_than_code(oldest_compatible) or quarantined_at is not None:
        return None
    current_time = clock if database_clock is None else database_clock.astimezone(UTC)
    groups, job_counts = list[_Group](), Counter[_Group]()
    for _, _, _, lane, course_id, batch_id, count in rows:
        group = _Group(lane, course_id, batch_id)
        if count:
            job_counts[group] += count
        elif lane is not None:
            groups.append(group)
    parameters = {
        **_compute_share_limits(current_time),
        "current_time": current_time,
        "claimant": worker,
        "reserved_since": current_time - RESERVED_PERIOD,
        "alive_since": current_time - ALIVE_PERIOD,
    }
    return current_time, _iterate_choices(_rank_groups(groups, job_counts), parameters)


def _compute_share_limits(current_time: datetime) -> dict[str, datetime]:
    return {"share_since": current_time - SHARE_WINDOW, "share_until": current_time + SHARE_WINDOW}


def _iterate_choices(ranked_groups: Iterable[Sequence[_Group]], parameters: Mapping[str, object]) -> Iterator[Choice]:
    """Yield, for groups with equal shares, the students without recently started jobs, then those with the fewest."""
    for tied_groups in ranked_groups:
        batch_ids = [group.batch_id for group in tied_groups if group.batch_id is not None]
        course_ids = [group.course_id for group in tied_groups if group.batch_id is None]
        places = {"queue": tied_groups[0].lane, "batch_ids": batch_ids, "course_ids": course_ids}
        for is_served in (False, True):
            yield Choice(_build_choice_query(bool(batch_ids), bool(course_ids), is_served), {**parameters, **places})


def _rank_groups(groups: Sequence[_Group], job_counts: Mapping[_Group, int]) -> Iterator[list[_Group]]:
    """Yield groups in the order in which their jobs are claimed; those with equal shares together."""
    lanes, courses, batches = Counter[JobQueue](), Counter[int](), Counter[str | None]()
    for group, count in job_counts.items():
        lanes[group.lane] += count
        courses[group.course_id] += count
        batches[group.batch_id] += count
    # Jobs without a batch have no batch to share with.
    batches[None] = 0
    has_batch_turn = lanes[JobQueue.INTERACTIVE] >= (BATCH_JOB_INTERVAL - 1) * (lanes[JobQueue.BATCH] + 1)
    first_queue = JobQueue.BATCH if has_batch_turn else JobQueue.INTERACTIVE

    def compute_rank(group: _Group) -> tuple[bool, bool, int, int]:
        is_completion = group.lane is JobQueue.COMPLETION
        return is_completion, group.lane is not first_queue, courses[group.course_id], batches[group.batch_id]

    for _, tied_groups in groupby(sorted(groups, key=compute_rank), compute_rank):
        yield list(tied_groups)


@cache
def _build_choice_query(has_batches: bool, has_courses: bool, is_served: bool) -> Select[Any]:
    """Return the query for the first job in batches, of courses without a batch, or of both."""
    in_batches, without_batch = (
        (_build_served_batch_query, _build_served_single_query)
        if is_served
        else (_build_batch_query, _build_single_query)
    )
    if not has_courses:
        return in_batches()
    if not has_batches:
        return without_batch()
    first_jobs = (in_batches().cte("first_in_batches"), without_batch().cte("first_without_batch"))
    jobs = union_all(*(select(first_job) for first_job in first_jobs)).subquery("jobs")
    return select(jobs).order_by(*jobs.c).limit(_ONE)


@cache
def _build_turn_query(dialect: str) -> Select[Any]:
    """Return the query for everything that a claim needs to know before it chooses.

    Each row has the database's clock (if it has one), the oldest compatible revision, and a quarantine. Then follows a
    group with waiting jobs, or one with recently started ones and their number; empty if there is no group.
    """
    limits: tuple[ColumnElement[datetime], ColumnElement[datetime]]
    if dialect == "sqlite":
        clock: ColumnElement[Any] = null()
        limits = bindparam("share_since"), bindparam("share_until")
    else:
        clock = func.statement_timestamp(type_=DateTime(timezone=True))
        window = literal_column(f"interval '{SHARE_WINDOW.total_seconds()} seconds'", Interval())
        limits = clock - window, clock + window
    quarantine = select(_WORKER.c.quarantined_at).where(_WORKER.c.name == bindparam("claimant"))
    groups = union_all(_select_shares(*limits), _select_waiting_batches(), _select_waiting_courses()).subquery("groups")
    checks = select(
        clock.label("clock"), select_oldest_compatible().scalar_subquery(), quarantine.scalar_subquery()
    ).subquery("checks")
    return select(checks, groups).select_from(checks.outerjoin(groups, true()))


def _select_shares(since: ColumnElement[datetime], until: ColumnElement[datetime]) -> Select[Any]:
    recent_jobs = select_recent_jobs(since, until).cte("recent")
    single_student = case((recent_jobs.c.batch_id.is_(None), recent_jobs.c.enrolment_id))
    columns = (recent_jobs.c.lane, recent_jobs.c.batch_id, single_student.label("enrolment_id"))
    counts = select(*columns, func.count().label("begun")).group_by(*columns).subquery("counts")
    # Subqueries, because PostgreSQL would join all students to the few groups.
    batch_course = select(_BATCH.c.course_id).where(_BATCH.c.id == counts.c.batch_id)
    student_course = select(_ENROLMENT.c.course_id).where(_ENROLMENT.c.id == counts.c.enrolment_id)
    course_id = func.coalesce(batch_course.scalar_subquery(), student_course.scalar_subquery())
    return select(counts.c.lane, course_id, counts.c.batch_id, counts.c.begun)


def _select_waiting_batches() -> Select[Any]:
    """Return a query for the open batches with waiting jobs.

    It jumps through the index from one batch to the next, without reading the jobs between.
    """
    lanes = union_all(*(select(queue.label("lane")) for queue in _QUEUES)).subquery("lanes")
    first_batch = select(func.min(_JOB.c.batch_id)).where(_IS_QUEUED, _JOB.c.lane == lanes.c.lane)
    waiting = select(lanes.c.lane, first_batch.scalar_subquery().label("batch_id")).cte("waiting", recursive=True)
    next_batch = select(func.min(_JOB.c.batch_id)).where(
        _IS_QUEUED, _JOB.c.lane == waiting.c.lane, _JOB.c.batch_id > waiting.c.batch_id
    )
    waiting = waiting.union_all(
        select(waiting.c.lane, next_batch.scalar_subquery()).where(waiting.c.batch_id.is_not(None))
    )
    return (
        select(waiting.c.lane, _BATCH.c.course_id, _BATCH.c.id, _ZERO)
        .join(_BATCH, _BATCH.c.id == waiting.c.batch_id)
        .where(_IS_OPEN)
    )


def _select_waiting_courses() -> Select[Any]:
    """Return a query for the courses with waiting jobs without a batch: single regrades, references of assignments."""
    return (
        select(_JOB.c.lane, _ENROLMENT.c.course_id, null(), _ZERO)
        .join(_ENROLMENT, _ENROLMENT.c.id == _JOB.c.enrolment_id)
        .where(_IS_QUEUED, _JOB.c.lane.in_(_QUEUES), _JOB.c.batch_id.is_(None))
        .distinct()
    )


def _build_batch_query() -> Select[Any]:
    """Return the query for the oldest job, in these batches, of a student without recently started jobs."""
    first_job = (
        select(_JOB.c.id)
        .where(*_match_due_jobs(), _JOB.c.batch_id == _BATCH.c.id, _match_students_not_served())
        .order_by(_JOB.c.queued_at, _JOB.c.id)
        .limit(_ONE)
        .with_for_update(skip_locked=True, key_share=True)
        .correlate(_BATCH)
        .scalar_subquery()
    )
    batches = select(first_job.label("id")).where(_BATCH.c.id.in_(bindparam("batch_ids", expanding=True)))
    first_jobs = batches.cte("first_jobs")
    chosen = _JOB.alias("chosen")
    return (
        select(chosen.c.queued_at, chosen.c.id)
        .join(first_jobs, first_jobs.c.id == chosen.c.id)
        .order_by(chosen.c.queued_at, chosen.c.id)
        .limit(_ONE)
    )


def _build_single_query() -> Select[Any]:
    """Return the same query for the jobs without a batch in these courses."""
    query = select(_JOB.c.queued_at, _JOB.c.id).where(
        *_match_due_jobs(), *_match_single_jobs(), _match_students_not_served()
    )
    return _choose_first(query)


def _build_served_batch_query() -> Select[Any]:
    """Return the query for the job, in these batches, of the student with the fewest recently started jobs, if any."""
    return _build_served_query(_JOB.c.batch_id.in_(bindparam("batch_ids", expanding=True)))


def _build_served_single_query() -> Select[Any]:
    """Return the same query for the jobs without a batch in these courses."""
    return _build_served_query(*_match_single_jobs())


def _build_served_query(*conditions: ColumnElement[bool]) -> Select[Any]:
    students = _build_recent_jobs()
    student_id = students.c.enrolment_id
    shares = select(student_id, func.count().label("begun")).group_by(student_id).subquery("shares")
    # Jobs of other students count, too: their last start may have left the share since the previous statement.
    begun = func.coalesce(shares.c.begun, 0)
    query = (
        select(begun, _JOB.c.queued_at, _JOB.c.id)
        .select_from(_JOB)
        .outerjoin(shares, shares.c.enrolment_id == _JOB.c.enrolment_id)
        .where(*_match_due_jobs(), *conditions)
    )
    return _choose_first(query, begun)


def _choose_first(query: Select[Any], *order: ColumnElement[int]) -> Select[Any]:
    ordered_jobs = query.order_by(*order, _JOB.c.queued_at, _JOB.c.id).limit(_ONE)
    return ordered_jobs.with_for_update(of=_JOB, skip_locked=True, key_share=True)


@cache
def _build_recent_jobs() -> CTE:
    """Return the recently started jobs, always as the same object, which a statement can contain several times."""
    return select_recent_jobs(bindparam("share_since"), bindparam("share_until")).cte("recent")


def _match_due_jobs() -> tuple[ColumnElement[bool], ...]:
    """Return the conditions for a job of one queue that the worker may claim, if its batch is open."""
    # A stopped worker returns its jobs without a fault, and then no error is stored.
    has_failed_here = and_(_JOB.c.attempt > 0, _JOB.c.worker == bindparam("claimant"), _JOB.c.error.is_not(None))
    is_reserved = and_(
        has_failed_here,
        _JOB.c.due_at > bindparam("reserved_since"),
        match_other_live_worker(bindparam("claimant"), bindparam("alive_since")),
    )
    return (
        _IS_QUEUED,
        _JOB.c.lane == bindparam("queue"),
        # An expression, because an index of this column is no use here, and SQLite has no statistics to see that.
        func.coalesce(_JOB.c.due_at, null()) <= bindparam("current_time"),
        not_(is_reserved),
    )


def _match_single_jobs() -> tuple[ColumnElement[bool], ...]:
    students = select(_ENROLMENT.c.id).where(_ENROLMENT.c.course_id.in_(bindparam("course_ids", expanding=True)))
    return _JOB.c.batch_id.is_(None), _JOB.c.enrolment_id.in_(students)


def _match_students_not_served() -> ColumnElement[bool]:
    return _JOB.c.enrolment_id.not_in(select(_build_recent_jobs().c.enrolment_id))
