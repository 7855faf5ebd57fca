"""A backup is complete and can be restored into either kind of database. A purge removes only old data."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import func, select, update

import acting
import report_builders
from benchmarks.harness.postgresql_server import create_database
from builders import grading_request, release_at_once, settings_in
from service.settings import Settings
from service.store.backup import back_up, restore
from service.store.batches.intake import accept_batch, accept_new_submissions
from service.store.engine import Store, open_engine, open_store
from service.store.grades import appeals, comments, overrides, results
from service.store.installation import load_secret
from service.store.purge import PurgeCounts, purge_submissions
from service.store.queue import jobs
from service.store.states import JobState
from service.store.tables import METADATA
from service.store.tables.grades import Appeal, Artifact, Comment, Override, TrialRow
from service.store.tables.people import Enrolment, Person
from service.store.tables.submissions import Batch, Job, SubmissionRow
from sim.errors import HostError, UsageError
from submissions.student_identity import RejectedSubmission

GRADE = replace(report_builders.shape_grade(), sandbox="Landlock 7, seccomp, process limits, policy 0")
TABLES = METADATA.sorted_tables


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.long)])
def elsewhere(request: pytest.FixtureRequest, tmp_path: Path) -> Settings:
    """Return settings with another empty database of each kind."""
    home = tmp_path / "elsewhere"
    if request.param == "sqlite":
        return settings_in(home)
    return settings_in(home, database_url=create_database(request.getfixturevalue("postgresql")))


def _batch(store: Store, name: str, *students: str) -> str:
    batch = accept_new_submissions(
        store, name, [grading_request(each) for each in students], [RejectedSubmission("x", "is bad.")], max_attempts=3
    )
    assert batch.batch is not None
    _grade_all(store)
    return batch.batch.id


def _grade_all(store: Store) -> None:
    while (claim := jobs.claim_job(store, "worker", 60)) is not None:
        own = replace(GRADE, secret_sha256=load_secret(store).sha256)
        jobs.finish_job(store, claim, results.prepare_grade(own), datetime.now(UTC))


def _filled(store: Store) -> str:
    """Store two students, a copy of a reviewed grade, a regrade, and a waiting job. Return the first batch."""
    first = _batch(store, "first", "ada", "bob 🤖")
    release_at_once(store)
    copied = accept_new_submissions(store, "same again", [grading_request("eve")], [], max_attempts=3).batch
    assert copied is not None
    _look_again(store, copied.jobs[0].job_id)
    acting.regrade(store, first, None, max_attempts=3, actor="staff")
    _grade_all(store)
    accept_batch(store, "waits", [grading_request("mia")], [], max_attempts=3)
    return first


def _look_again(store: Store, job_id: str) -> None:
    """Add the student's appeal, and an instructor's override, comment and answer."""
    with store.transaction() as session:
        appeal = appeals.open_appeal(session, session.get_one(Job, job_id).submission_id, "Why?")
        overrides.excuse_criterion(session, job_id, GRADE.criteria[0].id, "was ill", "staff")
        comments.add_comment(session, job_id, "", "Well done.", "staff")
        appeals.answer_appeal(session, 1, appeal, "See there.", "staff")


def _rows(store: Store) -> dict[str, list[Any]]:
    with store.reading() as session:
        return {
            table.name: [tuple(row) for row in session.execute(select(table).order_by(*table.primary_key.columns))]
            for table in TABLES
        }


def test_a_backup_brings_everything_back_into_either_kind(store: Store, elsewhere: Settings, tmp_path: Path) -> None:
    _filled(store)
    copy = tmp_path / "copy.db"
    back_up(store.engine, copy)
    with open_store(settings_in(tmp_path, database_url=f"sqlite:///{copy}")) as opened:
        assert _rows(opened) == _rows(store)
    with open_store(elsewhere) as other:
        restore(copy, other.engine)
        assert _rows(other) == _rows(store)
        # The waiting job is graded there, and new jobs get the next numbers.
        _grade_all(other)
        _batch(other, "later", "zoe")
        with other.reading() as session:
            assert session.scalar(select(func.count()).select_from(Job).where(Job.state == JobState.DONE)) == 7
        with pytest.raises(UsageError, match="is not empty, expected one in which nothing was submitted yet"):
            restore(copy, other.engine)


def test_a_backup_is_for_its_user_alone_and_never_writes_over_another(store: Store, tmp_path: Path) -> None:
    copy = tmp_path / "copy.db"
    back_up(store.engine, copy)
    assert copy.stat().st_mode & 0o777 == 0o600
    with pytest.raises(UsageError, match=r"copy.db exists already; name a new file"):
        back_up(store.engine, copy)
    with pytest.raises(HostError, match="cannot be copied to"):
        back_up(store.engine, tmp_path / "nowhere" / "copy.db")


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"hello, this is no database at all", "cannot be read"), (b"", "is no database of Robomark's")],
)
def test_what_is_no_backup_is_refused(content: bytes, words: str, tmp_path: Path) -> None:
    file = tmp_path / "copy.db"
    file.write_bytes(content)
    with (
        open_store(settings_in(tmp_path / "home")) as store,
        pytest.raises(UsageError, match=f"copy.db: {words}.*expected a file that robomark db backup made"),
    ):
        restore(file, store.engine)


def test_a_backup_of_a_newer_release_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    copy = tmp_path / "copy.db"
    with open_store(settings_in(tmp_path / "home")) as store:
        back_up(store.engine, copy)
        engine = open_engine(f"sqlite:///{copy}")
        with engine.begin() as connection:
            connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
        engine.dispose()
        with pytest.raises(HostError, match="newer Robomark"):
            restore(copy, store.engine)


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        (
            "CREATE VIEW endless AS WITH RECURSIVE t(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM t) SELECT x FROM t",
            "view",
        ),
        ("CREATE TRIGGER later AFTER INSERT ON course BEGIN DELETE FROM job; END", "trigger"),
        ("DELETE FROM installation", "is damaged"),
        ("UPDATE installation SET secret = CAST(x'ff' AS TEXT)", "is damaged"),
        ("UPDATE installation SET made_at = 'yesterday'", "is damaged"),
        ("DROP TABLE statement_head", "is damaged"),
        ("INSERT INTO person (id, created_at, operator) VALUES (1, CAST(x'fe' AS TEXT), 0)", "is damaged .person: "),
        ("UPDATE schema_compatibility SET oldest_compatible = '9999'", "is damaged"),
    ],
)
def test_a_changed_backup_is_refused(statement: str, words: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy.db"
    with open_store(settings_in(tmp_path / "home")) as store:
        back_up(store.engine, copy)
        engine = open_engine(f"sqlite:///{copy}")
        with engine.begin() as connection:
            connection.exec_driver_sql(statement)
        engine.dispose()
        with pytest.raises(UsageError, match=f"copy.db: .*{words}.*expected a file that robomark db backup made"):
            restore(copy, store.engine)


def test_a_backup_with_damaged_pages_is_refused_or_restored(tmp_path: Path) -> None:
    copy = tmp_path / "copy.db"
    with open_store(settings_in(tmp_path / "home")) as store:
        back_up(store.engine, copy)
        content = copy.read_bytes()
        for start in range(100, 20_000, 2_000):
            copy.write_bytes(content[:start] + b"\xa5" * 1_000 + content[start + 1_000 :])
            with contextlib.suppress(UsageError, HostError):
                restore(copy, store.engine)


def _counts(store: Store) -> dict[str, int]:
    with store.reading() as session:
        counts = {kind: session.scalar(select(func.count()).select_from(kind)) or 0 for kind in _COUNTED}
    return {kind.__tablename__: count for kind, count in counts.items()}


_COUNTED = (Batch, SubmissionRow, Job, TrialRow, Artifact, Enrolment, Person, Override, Comment, Appeal)


def _age(store: Store, *students: str) -> None:
    """Backdate the submissions of these students."""
    ids = select(Enrolment.id).where(Enrolment.student.in_(students))
    then = datetime.now(UTC) - timedelta(days=400)
    with store.transaction() as session:
        session.execute(update(SubmissionRow).where(SubmissionRow.enrolment_id.in_(ids)).values(created_at=then))


def test_a_purge_takes_what_is_old_and_no_more(store: Store) -> None:
    _filled(store)
    before = _counts(store)
    long_ago = datetime.now(UTC) - timedelta(days=100)
    _age(store, "eve", "mia")
    # mia's job still waits.
    assert purge_submissions(store, long_ago, "staff", only_count=True) == PurgeCounts(1, 1, 1)
    assert _counts(store) == before
    assert purge_submissions(store, long_ago, "staff") == PurgeCounts(1, 1, 1)
    after = _counts(store)
    assert {name: before[name] - after[name] for name in before} == {
        "batch": 1, "submission": 1, "job": 1, "trial": before["trial"] - after["trial"],
        "artifact": before["artifact"] - after["artifact"], "enrolment": 1, "person": 1,
        "override": 1, "comment": 1, "appeal": 1,
    }  # fmt: skip
    assert after["trial"] < before["trial"]
    # Newer work of the same students is complete.
    assert purge_submissions(store, long_ago, "staff") == PurgeCounts(0, 0, 0)


def test_a_purge_keeps_what_a_later_grade_is_a_copy_of(store: Store) -> None:
    _filled(store)
    long_ago = datetime.now(UTC) - timedelta(days=100)
    with store.reading() as session:
        copied = session.scalars(select(Job.copied_from).where(Job.copied_from.is_not(None))).one()
        source = session.scalars(
            select(Enrolment.student).join(Job, Job.enrolment_id == Enrolment.id).where(Job.id == copied)
        ).one()
    _age(store, source)
    assert purge_submissions(store, long_ago, "staff").submissions == 0
    _age(store, "eve")
    assert purge_submissions(store, long_ago, "staff").submissions == 2


def test_nothing_is_left_when_all_is_old(store: Store) -> None:
    _filled(store)
    jobs_left = purge_submissions(store, datetime.now(UTC) + timedelta(days=1), "staff")
    # mia's submission waits, and stays with her.
    assert jobs_left.submissions == 3
    assert _counts(store) == {
        "batch": 1, "submission": 1, "job": 1, "trial": 0, "artifact": 0, "enrolment": 1, "person": 1,
        "override": 0, "comment": 0, "appeal": 0,
    }  # fmt: skip
