"""The commands on the operators' page archive and restore a course, with either kind of database."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

import report_builders
from benchmarks.harness.postgresql_server import create_database
from builders import grading_request, prepared
from command import robomark
from service.settings import Settings
from service.store.batches.intake import accept_new_submissions
from service.store.engine import open_store
from service.store.installation import load_secret
from service.store.queue import jobs


def _graded_batch(settings: Settings) -> str:
    with open_store(settings) as store:
        accepted = accept_new_submissions(
            store, "spring", [grading_request("ada"), grading_request("bob")], [], max_attempts=3
        )
        assert accepted.batch is not None
        grade = replace(
            report_builders.shape_grade(), sandbox="Landlock 7, policy 0", secret_sha256=load_secret(store).sha256
        )
        while (claim := jobs.claim_job(store, "worker", 60)) is not None:
            jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))
        return accepted.batch.id


def _answer(*words: str | Path, home: Path, database: str) -> str:
    done = robomark(*words, ROBOMARK_HOME=str(home), ROBOMARK_DATABASE_URL=database)
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout


@pytest.fixture
def elsewhere(service_settings: Settings, request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return another empty database of the same kind."""
    if service_settings.database.startswith("sqlite"):
        return f"sqlite:///{tmp_path / 'elsewhere.db'}"
    return create_database(request.getfixturevalue("postgresql"))


@pytest.mark.long
def test_a_course_is_archived_purged_and_brought_back(
    service_settings: Settings, elsewhere: str, tmp_path: Path
) -> None:
    used: dict[str, Any] = {"home": service_settings.home, "database": service_settings.database}
    batch, archive = _graded_batch(service_settings), tmp_path / "spring.db"
    tomorrow = f"{datetime.now(UTC) + timedelta(days=2):%Y-%m-%d}"
    assert "revision" in _answer("db", "upgrade", **used)
    marks = _answer("batch", "export", batch, **used)
    assert "ada" in marks
    assert "2 submissions, 2 grades, 2 students to remove" in _answer("db", "purge", "--before", tomorrow, **used)
    gone = _answer("db", "purge", "--before", tomorrow, "--archive", archive, **used)
    assert "removed: 2 submissions, 2 grades, 2 students" in gone
    assert archive.stat().st_mode & 0o077 == 0
    assert batch not in _answer("batch", "list", **used)
    # The archive is a database that can be inspected and restored.
    opened: dict[str, Any] = {"home": tmp_path / "reading", "database": f"sqlite:///{archive}"}
    assert _answer("batch", "export", batch, **opened) == marks
    new: dict[str, Any] = {"home": tmp_path / "new", "database": elsewhere}
    _answer("db", "restore", archive, **new)
    assert _answer("batch", "export", batch, **new) == marks
    again = robomark("db", "restore", archive, ROBOMARK_HOME=str(new["home"]), ROBOMARK_DATABASE_URL=elsewhere)
    assert (again.returncode, "is not empty" in again.stderr) == (2, True)
