"""Fixtures for tests of the store and the queue: a database for each test, submissions, and uniform grades."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryDirectory
from typing import Any

import psycopg
from sqlalchemy import URL, make_url, text, update

from benchmarks.harness.postgresql_server import create_database
from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.queue.self_test_record import open_self_test_record
from service.settings import Settings
from service.store.batches.intake import AcceptedSubmission, accept_submission
from service.store.courses import policies
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store, open_store
from service.store.grades import recordings
from service.store.grades.results import PreparedGrade, prepare_grade
from service.store.installation import load_secret
from service.store.states import JobQueue, ReleaseRule
from service.store.tables.installation import SchemaCompatibility
from sim.recording import Recording
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import find_assignment
from submissions.batch_folder import BatchContents, read_batch
from submissions.grading_request import GradingRequest
from submissions.student_identity import People
from submissions.submission import Submission

#: Grades that were compressed, with the grade itself, so that its id stays in use.
_PREPARED: dict[int, tuple[Grade, PreparedGrade]] = {}
PROGRAM = "from ev3dev2.sound import Sound\nprint('hello')\n"


def settings_in(folder: Path, **changes: Any) -> Settings:
    """Return settings with their home in ``folder``, and waiting times short enough for a test.

    Workers search no causes of lost marks, because each search takes seconds.
    """
    values: dict[str, Any] = {
        "home": folder,
        "lease_seconds": 5.0,
        "backoff_seconds": 0.2,
        "notify_seconds": 1.0,
        "concurrency": 2,
        "search_causes": False,
    }
    return Settings(**(values | changes))


@contextmanager
def opened(settings: Settings) -> Iterator[Store]:
    """Open a database with these settings. An empty one gets a copy of migrated tables, without running migrations."""
    file = settings.home / "robomark.db"
    if settings.database == f"sqlite:///{file}" and not file.exists():
        settings.home.mkdir(mode=0o700, parents=True, exist_ok=True)
        file.touch(mode=0o600)
        tables, secret = _migrated()
        file.write_bytes(tables.replace(secret, token_hex(32).encode()))
    elif settings.database.startswith("postgresql"):
        _fill_postgresql(make_url(settings.database))
    with open_store(settings) as store:
        yield store


def upgraded_by_newer_release(store: Store, oldest_compatible: str) -> None:
    """Mark the tables as those of a newer release that is compatible with code from ``oldest_compatible`` on."""
    with store.transaction() as session:
        session.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        session.execute(update(SchemaCompatibility).values(oldest_compatible=oldest_compatible))


def asked_already(home: Path) -> Path:
    """Prepare a home where workers start at once: the self-test of this build is recorded there as passed.

    The self-test itself is covered by its own tests and by those of ``up`` and ``batch submit``.
    """
    run = home / "run"
    run.mkdir(mode=0o700, parents=True)
    open_self_test_record(run).note()
    return home


@cache
def _migrated() -> tuple[bytes, bytes]:
    """Return a freshly migrated database and the secret in it."""
    with TemporaryDirectory() as folder:
        settings = settings_in(Path(folder))
        with open_store(settings) as store:
            secret = load_secret(store)
        return (settings.home / "robomark.db").read_bytes(), secret.text.encode()


def _fill_postgresql(database: URL) -> None:
    """Replace the database, if it is empty, by a copy of migrated tables with a secret of its own."""
    with psycopg.connect(_render(database)) as connection:
        if connection.execute("SELECT 1 FROM pg_tables WHERE schemaname = 'public'").fetchone():
            return
    template = _migrated_database(_render(database.set(database="postgres")))
    with psycopg.connect(_render(database.set(database="postgres")), autocommit=True) as connection:
        connection.execute(f'DROP DATABASE "{database.database}"')
        connection.execute(f'CREATE DATABASE "{database.database}" TEMPLATE "{template}"')
    with psycopg.connect(_render(database)) as connection:
        connection.execute("UPDATE installation SET secret = %s", [token_hex(32)])


@cache
def _migrated_database(server: str) -> str:
    """Migrate a database on the server, and return its name."""
    url = create_database(server)
    with TemporaryDirectory() as folder, open_store(settings_in(Path(folder), database_url=url)):
        pass
    return make_url(url).database or ""


def _render(url: URL) -> str:
    return url.set(drivername="postgresql").render_as_string(hide_password=False)


def echo() -> Assignment:
    return find_assignment("echo-responder")


def patient_echo() -> Assignment:
    """Return the echo assignment with time for an endless program to be found running, also on a busy machine."""
    return replace(echo(), limits=replace(echo().limits, program_cpu=5))


def grading_request(
    student: str = "ada", program: str = PROGRAM, assignment: Assignment | None = None
) -> GradingRequest:
    """Return a small submission for the echo assignment."""
    responder = SourceFile("responder.py", "def responder(msg):\n    return msg\n")
    submission = Submission(student, SourceFile("robot.py", program), responder)
    return GradingRequest(submission, assignment or echo(), f"{student}.zip")


def accept_one(
    store: Store, student: str = "ada", *, lane: JobQueue = JobQueue.INTERACTIVE, max_attempts: int = 3
) -> AcceptedSubmission:
    return accept_submission(store, grading_request(student), lane=lane, max_attempts=max_attempts)


def release_at_once(store: Store) -> None:
    """Let the students of the first course see all grades when they are graded."""
    with store.transaction() as session:
        policies.set_policy(session, 1, "", PolicyLimits(release=ReleaseRule.AT_ONCE))


def prepared(grade: Grade) -> PreparedGrade:
    """Return the grade as jobs end with it. It is compressed once, even if many jobs get it."""
    known_grade, prepared_grade = _PREPARED.get(id(grade), (None, None))
    if known_grade is not grade or prepared_grade is None:
        if len(_PREPARED) > 20:
            _PREPARED.clear()
        prepared_grade = prepare_grade(grade)
        _PREPARED[id(grade)] = grade, prepared_grade
    return prepared_grade


def comparable(grade: Grade) -> tuple[Grade, list[bytes]]:
    """Split a grade into two comparable parts: everything but the recordings, and every bit of the recordings."""
    return replace(grade, trials=()), [_canonical(trial.recording) for trial in grade.trials]


def _canonical(recording: Recording) -> bytes:
    # A builder's 560 and a stored 560.0 are the same number, written differently.
    return recordings.to_bytes(recordings.from_bytes(recordings.to_bytes(recording)))


def read_named_batch(path: Path, assignment: str | None, people: People | None = None) -> BatchContents:
    """Read a batch for the assignment with this id, or one whose submissions name their own."""
    return read_batch(path, None if assignment is None else find_assignment(assignment), people)
