"""Web response times: the page of a batch of 2000, and uploads of a class of 200 within a minute.

It measures real time, so run it on an idle machine: ``python -m benchmarks web``.
"""

from __future__ import annotations

import http.client
import random
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import func, select

from benchmarks import many_rows
from benchmarks.graded_store import ASSIGNMENT, build_short_request, create_graded_batch
from benchmarks.harness.postgresql_server import PostgresqlServer, create_database
from benchmarks.harness.running_service import start_service
from benchmarks.measurement import COUNT, MILLISECONDS, SECONDS, Measurement, median
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.engine import Store
from service.store.people import credentials, membership
from service.store.people.students import DEFAULT_COURSE
from service.store.queue.metrics import compute_quantile
from service.store.states import CredentialKind, JobState
from service.store.tables.submissions import Job
from service.web.access import CSRF_HEADER, SESSION_COOKIE, derive_csrf_token
from submissions.assignment.reader import find_assignment
from submissions.student_identity import Student

_STUDENTS = 200
_WITHIN_SECONDS = 60.0
_AT_A_TIME = 20
_PATIENCE_SECONDS = 900.0
_BOUNDARY = "part"


@dataclass(frozen=True, slots=True)
class _Browser:
    """A user who is signed in at a server on this machine."""

    port: int
    secret: str

    def get(self, path: str) -> tuple[int, float]:
        """Return the status of a response, and the seconds until its last byte."""
        return self._ask("GET", path, b"", {})

    def upload(self, path: str, files: Sequence[tuple[str, str]]) -> tuple[int, float]:
        parts = [
            f'--{_BOUNDARY}\r\nContent-Disposition: form-data; name="files"; filename="{name}"\r\n\r\n{text}\r\n'
            for name, text in files
        ]
        body = ("".join(parts) + f"--{_BOUNDARY}--\r\n").encode()
        headers = {
            "content-type": f"multipart/form-data; boundary={_BOUNDARY}",
            CSRF_HEADER: derive_csrf_token(self.secret),
        }
        return self._ask("POST", path, body, headers)

    def _ask(self, method: str, path: str, body: bytes, headers: dict[str, str]) -> tuple[int, float]:
        start = time.perf_counter()
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            connection.request(method, path, body, {"cookie": f"{SESSION_COOKIE}={self.secret}", **headers})
            answer = connection.getresponse()
            answer.read()
            return answer.status, time.perf_counter() - start
        finally:
            connection.close()


def measure(times: int) -> list[Measurement]:
    """Measure the page, then the class, both on PostgreSQL."""
    with PostgresqlServer() as server:
        return [*_measure_page(server, max(times, 5)), *_measure_class(server)]


def _measure_page(server: PostgresqlServer, times: int) -> list[Measurement]:
    with ExitStack() as stack:
        store, port = start_service(stack, create_database(server.url), workers=1)
        many_rows.fill(store, create_graded_batch(store))
        with store.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.exec_driver_sql("VACUUM ANALYZE")
        browser = _Browser(port, _create_session(store, _create_instructor(store)))
        path = f"/courses/1/batches/{many_rows.format_batch_name(3)}"
        for _ in range(2):
            status, _ = browser.get(path)
        durations = [browser.get(path)[1] for _ in range(times)]
    if status != 200:
        raise RuntimeError(f"the page of a batch answered {status}")
    details = f"most {1000 * max(durations):.0f} ms"
    return [
        Measurement(
            "web, PostgreSQL: page of a batch of 2000", 1000 * median(durations), MILLISECONDS, 300, details=details
        )
    ]


def _create_instructor(store: Store) -> int:
    """Return the id of an instructor of the first course."""
    with store.transaction() as session:
        return membership.make_instructor(session, DEFAULT_COURSE, Student("instructor")).person_id


def _measure_class(server: PostgresqlServer) -> list[Measurement]:
    with ExitStack() as stack:
        store, port = start_service(stack, create_database(server.url), workers=2)
        names = [f"student-{number}" for number in range(_STUDENTS)]
        with store.transaction() as session:
            members = [membership.make_student(session, DEFAULT_COURSE, Student(name)).person_id for name in names]
            open_assignments.prepare_assignment(session, 1, freeze_assignment(find_assignment(ASSIGNMENT)))
            open_assignments.open_for_students(session, 1, ASSIGNMENT)
        browsers = [_Browser(port, _create_session(store, person_id)) for person_id in members]
        start = time.monotonic()
        chance = random.Random(1)
        moments = sorted(chance.uniform(0, _WITHIN_SECONDS) for _ in names)

        def upload(number: int) -> tuple[int, float]:
            time.sleep(max(0.0, start + moments[number] - time.monotonic()))
            submission = build_short_request(names[number]).submission
            assert submission.program is not None
            assert submission.responder is not None
            files = [("robot.py", submission.program.text), ("responder.py", submission.responder.text)]
            return browsers[number].upload(f"/courses/1/mine/{ASSIGNMENT}", files)

        with ThreadPoolExecutor(_AT_A_TIME) as pool:
            answers = list(pool.map(upload, range(_STUDENTS)))
        last_seconds = _wait_until_graded(store, start)
        with store.reading() as session:
            job_count = session.scalar(select(func.count()).select_from(Job)) or 0
            graded_count = session.scalar(select(func.count()).where(Job.state == JobState.DONE)) or 0
    durations = sorted(seconds for _, seconds in answers)
    lost_count = _STUDENTS - min(job_count, graded_count, sum(status == 303 for status, _ in answers))
    title = f"web, PostgreSQL, 2 workers: {_STUDENTS} students upload within a minute"
    details = f"half {compute_quantile(durations, 0.5):.3f} s, 19 of 20 {compute_quantile(durations, 0.95):.3f} s"
    return [
        Measurement(f"{title}: slowest answer", durations[-1], SECONDS, 1.0, details=details),
        Measurement(f"{title}: lost", lost_count, COUNT, 0),
        Measurement(f"{title}: the last is graded after", last_seconds, SECONDS),
    ]


def _create_session(store: Store, person_id: int) -> str:
    with store.transaction() as session:
        return credentials.issue_credential(session, person_id, CredentialKind.SESSION, timedelta(hours=1))


def _wait_until_graded(store: Store, start: float) -> float:
    while True:
        with store.reading() as session:
            unfinished = session.scalar(select(func.count()).where(Job.state.in_((JobState.QUEUED, JobState.RUNNING))))
        if not unfinished:
            return time.monotonic() - start
        if time.monotonic() - start > _PATIENCE_SECONDS:
            raise RuntimeError("the class's submissions do not come to an end")
        time.sleep(0.1)
