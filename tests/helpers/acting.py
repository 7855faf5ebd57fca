"""Operations on a store, called as an operator on the server calls them, without workers to notify."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from builders import settings_in
from service.operations import batches, exports, regrades
from service.operations.batches import BatchControlResult, RetryCounts
from service.operations.context import Actor, Service
from service.operations.exports import Download, ExportRequest
from service.operations.regrades import PublicationCounts, RegradeBatch
from service.store.engine import Store
from service.store.states import JobQueue
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job
from submissions.assignment.definition import Assignment


@dataclass(frozen=True, slots=True)
class Notices:
    """Records the notifications meant for workers: the queue and the number of jobs."""

    sent: list[tuple[str, int]] = field(default_factory=list)

    def grade(self, lane: JobQueue, count: int = 1) -> None:
        if count > 0:
            self.sent.append((lane.value, count))

    def notify_test_runs(self, count: int = 1) -> None:
        self.sent.append(("tryouts", count))

    def plot(self, count: int = 1) -> None:
        self.sent.append(("plots", count))


def service_on(store: Store, max_attempts: int = 3) -> Service:
    return Service(settings_in(Path("/nonexistent"), max_attempts=max_attempts), store, Notices())


def machine(name: str = "staff") -> Actor:
    return Actor(name, operator=True)


def pause(store: Store, batch_id: str, actor: str = "staff") -> BatchControlResult:
    return batches.pause(service_on(store), machine(actor), _course(store, batch_id), batch_id)


def resume(store: Store, batch_id: str, actor: str = "staff") -> BatchControlResult:
    return batches.resume(service_on(store), machine(actor), _course(store, batch_id), batch_id)


def cancel(store: Store, batch_id: str, actor: str = "staff") -> BatchControlResult:
    return batches.cancel(service_on(store), machine(actor), _course(store, batch_id), batch_id)


def retry(store: Store, batch_id: str | None, actor: str = "staff") -> RetryCounts:
    return batches.retry_dead(service_on(store), machine(actor), batch_id)


def publish(
    store: Store, batch_id: str, actor: str = "staff", *, includes_held_back: bool = False
) -> PublicationCounts:
    course_id = _course(store, batch_id)
    return regrades.publish(
        service_on(store), machine(actor), course_id, batch_id, includes_held_back=includes_held_back
    )


def publish_one(
    store: Store, job_id: str, actor: str = "staff", *, includes_held_back: bool = False
) -> PublicationCounts:
    course_id = _course_of_job(store, job_id)
    return regrades.publish_one(
        service_on(store), machine(actor), course_id, job_id, includes_held_back=includes_held_back
    )


def regrade(
    store: Store,
    batch_id: str,
    assignment: Assignment | None = None,
    *,
    max_attempts: int = 3,
    actor: str = "staff",
) -> RegradeBatch:
    service, course_id = service_on(store, max_attempts), _course(store, batch_id)
    return regrades.regrade_batch(service, machine(actor), course_id, batch_id, assignment or "")


def regrade_one(
    store: Store, job_id: str, assignment: Assignment | None = None, *, max_attempts: int = 3, actor: str = "staff"
) -> str:
    service, course_id = service_on(store, max_attempts), _course_of_job(store, job_id)
    return regrades.regrade_one(service, machine(actor), course_id, job_id, assignment or "")


def export_file(store: Store, batch_id: str, form: str, *, published: bool, given: str | None = None) -> Download:
    request = ExportRequest(form, published, given)
    return exports.download(service_on(store), machine(), _course(store, batch_id), batch_id, request)


def _course(store: Store, batch_id: str) -> int:
    with store.reading() as session:
        row = session.get(Batch, batch_id)
        return 0 if row is None else row.course_id


def _course_of_job(store: Store, job_id: str) -> int:
    with store.reading() as session:
        return session.get_one(Enrolment, session.get_one(Job, job_id).enrolment_id).course_id
