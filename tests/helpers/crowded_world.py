"""Many more rows of everything that the pages of ``web_world`` list. Copying rows takes almost no time."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any

from sqlalchemy import ColumnElement, insert, inspect, select
from sqlalchemy.orm import Session

from service.store.ids import generate_id
from service.store.states import CredentialKind, JobState, Role, Standing
from service.store.tables.base import Base
from service.store.tables.courses import AssignmentVersion, Course, Delivery, Extension, OpenAssignment, Policy, Webhook
from service.store.tables.grades import Appeal, Artifact, Comment, CriterionResultRow, Override, TrialRow
from service.store.tables.installation import Heartbeat
from service.store.tables.people import Credential, Enrolment, LtiPlatform, Person
from service.store.tables.submissions import Batch, Job, SubmissionRow
from web import Web
from web_world import World

_AT = datetime.now(UTC)


def crowd(web: Web, world: World, numbers: Iterable[int]) -> None:
    """Add an attempt, a student, a batch, an assignment, a course, an appeal and so on for each number."""
    with web.store.transaction() as session:
        copies = _Copies(session, world)
        for number in numbers:
            copies.add_one_of_each(number)
        copies.add_rows_of_jobs()


class _Copies:
    """Copies rows of the world. Values that are not given stay the same."""

    def __init__(self, session: Session, world: World) -> None:
        self._session, self._world = session, world
        values = world.values
        self._batch_id, self._assignment, self._job_id = values["batch_id"], values["assignment"], values["job_id"]
        self._criterion = values["criterion"]
        self._rows: dict[type[Base], list[dict[str, Any]]] = {}
        self._rows_of_jobs: dict[type[Base], list[dict[str, Any]]] = {
            kind: [] for kind in (TrialRow, CriterionResultRow, Artifact)
        }
        self._regrade = self._copy(Batch, Batch.id == self._batch_id, id=generate_id(), regrade_of=self._batch_id)

    def add_one_of_each(self, number: int) -> None:
        ada = self._world.ada.enrolment_id
        student, unlucky = (self._enrol(1, f"{who}-{number}") for who in ("student", "unlucky"))
        self._grade(ada, self._batch_id, 2 + number, number)
        self._grade(student, self._batch_id, 1, number)
        self._grade(student, self._copy(Batch, Batch.id == self._batch_id, id=generate_id()), 2, number)
        failed: dict[str, Any] = {"state": JobState.DEAD, "error": "the disk is full", "marks": None, "verdict": None}
        self._submit(unlucky, self._batch_id, 1, **failed)
        self._open_task(f"task-{number}")
        self._add_course(number)
        self._add_others(number)

    def _grade(self, enrolment_id: int, batch_id: str, attempt: int, number: int) -> None:
        """Add a graded attempt with a regrade, an appeal, a comment, and adjusted marks."""
        submission_id, job_id = self._submit(enrolment_id, batch_id, attempt)
        regrade = {"regrade_of": job_id, "standing": Standing.PROPOSED, "submission_id": submission_id}
        self._job(enrolment_id, self._regrade, **regrade)
        answer = {"answer": "It is right.", "actor": "grace", "answered_at": _AT} if number % 2 else {}
        self._add(Appeal, submission_id=submission_id, text="Please look again.", asked_at=_AT, **answer)
        comment = {"submission_id": submission_id, "criterion": self._criterion, "actor": "grace", "made_at": _AT}
        self._add(Comment, text="Well done.", **comment)
        self._add(Override, marks=Decimal(1), reason="It was close.", **comment)

    def _submit(
        self, enrolment_id: int, batch_id: str | None, attempt: int, assignment: str = "", **job: Any
    ) -> tuple[int, str]:
        submission_id = self._copy(
            SubmissionRow,
            SubmissionRow.id == 1,
            enrolment_id=enrolment_id,
            batch_id=batch_id,
            attempt=attempt,
            assignment=assignment or self._assignment,
            sha256=generate_id(),
        )
        return submission_id, self._job(enrolment_id, batch_id, submission_id=submission_id, **job)

    def _job(self, enrolment_id: int, batch_id: str | None, **changes: Any) -> str:
        of_job = {"id": generate_id(), "enrolment_id": enrolment_id, "batch_id": batch_id}
        job_id: str = self._copy(Job, Job.id == self._job_id, **of_job, **changes)
        for kind, rows in self._rows_of_jobs.items():
            rows += [
                row | {"job_id": job_id} for row in self._read(kind, kind.__table__.columns["job_id"] == self._job_id)
            ]
        return job_id

    def add_rows_of_jobs(self) -> None:
        """Add trials, criteria and files of all added jobs."""
        for kind, rows in self._rows_of_jobs.items():
            self._session.execute(insert(kind), rows)

    def _open_task(self, task: str) -> None:
        """Add an assignment that Ada has submitted to, with a policy and an extension."""
        ada = self._world.ada.enrolment_id
        version = self._copy(
            AssignmentVersion, AssignmentVersion.id == 1, assignment=task, title=task.title(), sha256=generate_id()
        )
        batch_id = self._copy(Batch, Batch.id == self._batch_id, id=generate_id())
        opened = {"assignment_version_id": version, "opened_at": _AT, "batch_id": batch_id, "names_hidden": True}
        self._add(OpenAssignment, course_id=1, assignment=task, **opened)
        self._add(Policy, course_id=1, assignment=task, due_at=_AT + timedelta(days=1), attempts=9)
        self._add(Extension, enrolment_id=ada, assignment=task, more_attempts=1)
        self._submit(ada, batch_id, 1, task, assignment_version_id=version)
        waiting: dict[str, Any] = {"state": JobState.QUEUED, "verdict": None, "marks": None}
        self._submit(ada, batch_id, 2, task, assignment_version_id=version, **waiting)

    def _add_course(self, number: int) -> None:
        course_id = self._add(Course, name=f"course {number}", created_at=_AT)
        self._enrol(course_id, f"ada-{number}", person_id=self._world.ada.person_id)
        self._enrol(course_id, f"grace-{number}", person_id=self._world.grace.person_id, role=Role.INSTRUCTOR)

    def _enrol(self, course_id: int, student: str, **changes: Any) -> int:
        person_id = changes.pop("person_id", None) or self._add(Person, created_at=_AT)
        of_course = {"course_id": course_id, "student": student, "written": student, "person_id": person_id}
        enrolment_id: int = self._copy(Enrolment, Enrolment.id == self._world.ada.enrolment_id, **of_course, **changes)
        return enrolment_id

    def _add_others(self, number: int) -> None:
        """Add a platform, a worker, a webhook with a delivery, a comment, and a session for each person."""
        address = f"https://p{number}.example.org"
        urls = dict.fromkeys(("issuer", "authorization_url", "token_url", "keys_url"), address)
        self._add(LtiPlatform, name=f"platform {number}", client_id="client", created_at=_AT, **urls)
        worker = {"host": "here", "concurrency": 1, "grader_version": "1", "sandbox": "Landlock"}
        self._add(Heartbeat, worker=f"worker-{number}", started_at=_AT, seen_at=_AT, **worker)
        hook = generate_id()
        self._add(Webhook, id=hook, course_id=1, url=address, secret="", created_at=_AT)
        self._add(
            Delivery, id=generate_id(), webhook_id=hook, event="grade.finished", payload={}, made_at=_AT, due_at=_AT
        )
        self._add(Comment, submission_id=1, text=f"Comment {number}.", actor="grace", made_at=_AT)
        for member in (self._world.ada, self._world.grace):
            lasting = {"kind": CredentialKind.SESSION, "created_at": _AT, "expires_at": _AT + timedelta(days=1)}
            self._add(Credential, id=generate_id(), person_id=member.person_id, sha256=generate_id(), **lasting)

    def _copy(self, kind: type[Base], which: ColumnElement[bool], **changes: Any) -> Any:
        """Copy the selected row, which is cached for each table. Return the key of the copy."""
        (row,) = self._read(kind, which)
        return self._add(kind, **(row | changes))

    def _read(self, kind: type[Base], which: ColumnElement[bool]) -> list[dict[str, Any]]:
        if kind not in self._rows:
            rows = self._session.execute(select(*kind.__table__.columns).where(which)).mappings()
            self._rows[kind] = [{name: value for name, value in row.items() if name != "id"} for row in rows]
        return self._rows[kind]

    def _add(self, kind: type[Base], /, **values: Any) -> Any:
        row = kind(**values)
        self._session.add(row)
        self._session.flush()
        key = inspect(row).identity
        assert key is not None
        return key[0]
