"""A queue without progress is reported as a problem, even if all components are running."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import text, update
from sqlalchemy.exc import OperationalError

import report_builders
from builders import accept_one, grading_request, prepared, upgraded_by_newer_release
from service import doctor
from service.doctor import examine_service
from service.settings import Settings
from service.store.batches.intake import accept_batch
from service.store.engine import Store, now
from service.store.grades import plots
from service.store.queue import jobs, metrics, test_runs, workers
from service.store.queue.workers import WorkerDescription
from service.store.revision import SchemaState, find_newest_revision
from service.store.states import BatchState
from service.store.tables.installation import SchemaCompatibility
from service.store.tables.submissions import Batch, Job
from service.version import GRADER_VERSION


def _check_machine(settings: Settings, what: str) -> doctor.Finding:
    """Run one check of this machine. All of them together take seconds."""
    (check,) = [each for each in doctor.CHECKS if each.what == what]
    return doctor._run_machine_check(check, settings)


def _queue(settings: Settings, store: Store) -> tuple[bool, str]:
    finding = {each.what: each for each in examine_service(settings.with_broker("redis://127.0.0.1:1/0"), store)}[
        "queue"
    ]
    return finding.well, finding.sentence


@pytest.mark.parametrize(("minutes", "is_begun", "well"), [(1, False, True), (10, False, False), (10, True, True)])
def test_a_queue_that_stands_still_is_not_well(
    service_settings: Settings, store: Store, minutes: int, is_begun: bool, well: bool
) -> None:
    assert _queue(service_settings, store) == (True, "0 queued")
    workers.record_heartbeat(store, WorkerDescription("worker", "host", 1, "0", "all of it"))
    accept_one(store, "ada")
    accept_one(store, "bob")
    with store.transaction() as session:
        session.execute(update(Job).values(queued_at=now(session) - timedelta(minutes=minutes)))
    if is_begun:
        assert jobs.claim_job(store, "worker", 60) is not None
    finding, sentence = _queue(service_settings, store)
    assert finding is well
    assert ("start no jobs" in sentence) is not well


@pytest.mark.parametrize(("ended_seconds_ago", "well"), [(5, True), (600, False)])
def test_a_backlog_between_two_jobs_is_well(
    service_settings: Settings, store: Store, ended_seconds_ago: int, well: bool
) -> None:
    workers.record_heartbeat(store, WorkerDescription("worker", "host", 1, "0", "all of it"))
    accept_one(store, "ada")
    accept_one(store, "bob")
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    with store.transaction() as session:
        at = now(session)
        session.execute(update(Job).values(queued_at=at - timedelta(minutes=10)))
        ended = at - timedelta(seconds=ended_seconds_ago)
        moments = {"started_at": ended - timedelta(seconds=2), "finished_at": ended}
        session.execute(update(Job).where(Job.id == claim.job_id).values(**moments))
    assert _queue(service_settings, store)[0] is well


@pytest.mark.parametrize(
    ("revision", "oldest_compatible", "advice"),
    [
        ("0001", find_newest_revision(), "robomark db upgrade"),
        ("9999", "9998", "install the newer release and restart"),
        ("9999", find_newest_revision(), None),
    ],
)
def test_the_advice_fits_the_direction(
    service_settings: Settings, store: Store, revision: str, oldest_compatible: str, advice: str | None
) -> None:
    with store.transaction() as session:
        session.execute(text("UPDATE alembic_version SET version_num = :revision"), {"revision": revision})
        session.execute(update(SchemaCompatibility).values(oldest_compatible=oldest_compatible))
    of_service = examine_service(service_settings.with_broker("redis://127.0.0.1:1/0"), store)
    for each in (_check_machine(service_settings, "database"), *of_service):
        if each.what == "database":
            assert each.well is (advice is None)
            assert (advice or revision) in each.sentence


@pytest.mark.parametrize(
    ("waiting", "before"),
    [
        ({1: {"ours": 5}}, 5),
        ({1: {"ours": 5, "other": 9}}, 10),
        ({1: {"ours": 5, "other": 2}}, 7),
        ({1: {"ours": 5}, 2: {"a": 30, "b": 30}}, 10),
        ({1: {"ours": 5}, 2: {"a": 3}, 3: {"c": 40}}, 13),
        ({1: {"ours": 5, "other": 9}, 2: {"a": 30}}, 20),
        ({2: {"a": 30}}, 0),
    ],
)
def test_the_time_left_counts_the_share_of_others(waiting: dict[int, dict[str | None, int]], before: int) -> None:
    assert metrics._count_jobs_before_end(waiting, "ours") == before


def test_the_time_left_is_longer_while_others_wait(store: Store) -> None:
    ours = accept_batch(store, "ours", [grading_request(name) for name in ("ada", "bob", "cyd")], [], max_attempts=3)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    with store.transaction() as session:
        session.execute(
            update(Job).where(Job.id == claim.job_id).values(started_at=now(session) - timedelta(minutes=1))
        )

    def left() -> float:
        with store.reading() as session:
            pace = metrics.estimate_pace(session, ours.id)
        assert pace is not None
        return pace.left.total_seconds()

    alone = left()
    other = accept_batch(store, "other", [grading_request(name) for name in ("eve", "fay", "gus")], [], max_attempts=3)
    assert left() >= 1.5 * alone
    with store.transaction() as session:
        session.execute(update(Batch).where(Batch.id == other.id).values(state=BatchState.PAUSED))
    assert left() < 1.5 * alone


@pytest.mark.parametrize("message", ["database or disk is full", "unable to open database file"])
def test_a_full_disk_is_named(
    service_settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch, message: str
) -> None:
    cause = sqlite3.OperationalError(message)
    if "full" in message:
        cause.sqlite_errorcode = sqlite3.SQLITE_FULL

    def fail(_engine: object) -> SchemaState:
        raise OperationalError("SELECT 1", {}, cause)

    monkeypatch.setattr(doctor, "load_schema_state", fail)
    of_service = examine_service(service_settings.with_broker("redis://127.0.0.1:1/0"), store)
    (finding,) = [each for each in of_service if each.what == "database"]
    assert not finding.well
    assert finding.sentence == ("the disk is full" if "full" in message else "no connection to the database")


def test_the_clock_of_a_file_is_not_compared_with_itself(service_settings: Settings, store: Store) -> None:
    finding = _check_machine(service_settings, "clock")
    assert ("a local file" in finding.sentence) is (store.engine.dialect.name == "sqlite")


def test_nothing_is_claimed_from_tables_that_need_newer_code(store: Store) -> None:
    claims: dict[str, Callable[[], object]] = {
        "job": lambda: jobs.claim_job(store, "worker", 60),
        "tryout": lambda: test_runs.claim_test_run(store, 60),
        "plots": lambda: plots.claim_plots(store, 60),
    }
    prepared_grade = prepared(report_builders.faulty_grade())
    for student in ("ada", "bob", "eve"):
        accept_one(store, student)
    finished, running = jobs.claim_job(store, "worker", 60), jobs.claim_job(store, "worker", 60)
    assert finished is not None
    assert running is not None
    jobs.finish_job(store, finished, prepared_grade, datetime.now(UTC))
    with store.transaction() as session:
        job = session.get_one(Job, running.job_id)
        test_runs.queue_test_run(session, job.enrolment_id, job.assignment_version_id, b"")
    upgraded_by_newer_release(store, "9998")
    assert [name for name, take in claims.items() if take() is not None] == []
    # Running jobs are finished.
    jobs.renew_lease(store, running, 60, 0.5)
    jobs.finish_job(store, running, prepared_grade, datetime.now(UTC))
    upgraded_by_newer_release(store, find_newest_revision())
    assert [name for name, take in claims.items() if take() is not None] == list(claims)


@pytest.mark.parametrize(
    ("problems", "well"), [(["", ""], True), (["", "restart it"], True), (["restart it"] * 2, False)]
)
def test_workers_that_must_be_restarted_are_named(
    service_settings: Settings, store: Store, problems: list[str], well: bool
) -> None:
    for number, problem in enumerate(problems):
        workers.record_heartbeat(store, WorkerDescription(f"worker-{number}", "host", 1, "0", "all of it", problem))
    of_service = examine_service(service_settings.with_broker("redis://127.0.0.1:1/0"), store)
    (ready,) = [each for each in of_service if each.what == "workers"]
    machine_finding = _check_machine(service_settings, "workers")
    assert (ready.well, machine_finding.well) == (well, not any(problems))
    for finding in (ready, machine_finding):
        assert ("restart it" in finding.sentence) is any(problems)
    assert "worker-" not in ready.sentence


def test_a_release_that_is_exchanged_in_place_is_noticed(
    service_settings: Settings, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ready() -> tuple[bool, str]:
        of_service = examine_service(service_settings.with_broker("redis://127.0.0.1:1/0"), store)
        (finding,) = [each for each in of_service if each.what == "release"]
        return finding.well, finding.sentence

    assert ready()[0]
    info = tmp_path / "site" / "robomark-99.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: robomark\nVersion: 99\n")
    monkeypatch.syspath_prepend(info.parent)
    well, sentence = ready()
    assert not well
    assert f"the installed release (99) differs from the running one ({GRADER_VERSION}); restart" in sentence
