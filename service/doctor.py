"""Checks of this machine and of the whole service that find problems which prevent grading.

``robomark doctor`` prints the findings for this machine, ``/health/ready`` those for the service. Checks never raise.
The only change is that the home folder is created.
"""

from __future__ import annotations

import errno
import os
import platform
import shutil
import sqlite3
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib import metadata

import redis
import structlog
from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from responders.sandbox import control_group
from service.home import open_home
from service.installed_files import check_installed_files
from service.queue.broker import create_broker_client, fetch_broker_version, is_broker_responding, prepare_socket_path
from service.queue.live_workers import is_worker_running
from service.settings import Settings
from service.store.engine import Store, now, open_engine
from service.store.installation import load_secret
from service.store.queue import workers
from service.store.queue.metrics import collect_queue_metrics
from service.store.revision import find_newest_revision, load_schema_state
from service.store.states import JobState
from service.store.tables.submissions import Job
from service.version import GRADER_VERSION, describe_release_problem
from sim.errors import RobomarkError
from sim.sentences import Sentence
from submissions.seeds import format_secret_name

_FREE_BYTES = 1_000_000_000
_OLDEST_BROKER = (6, 2)
_CLOCK_DIFFERENCE_SECONDS = 5.0
_LONG_WAIT_SECONDS = 60.0
_STUCK_SECONDS = 180.0
_READY_SECONDS = 2.0
#: Two findings of one check, the same in all languages.
_LIST = "%(first)s; %(next)s"
#: SQLSTATE of PostgreSQL.
_DISK_FULL = "53100"

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check: whether it passed, and a sentence."""

    what: str
    well: bool
    sentence: str


@dataclass(frozen=True, slots=True)
class Check:
    """A check of this machine, and optionally of the whole service if grading depends on it.

    Findings for the service are public, so they contain no addresses, names or error texts.
    """

    what: str
    check_machine: Callable[[Settings], tuple[bool, str]]
    check_service: Callable[[Settings, Store], tuple[bool, str]] | None = None


def examine_machine(settings: Settings) -> list[Finding]:
    """Run all checks of this machine, in reading order."""
    return [_run_machine_check(check, settings) for check in CHECKS]


def examine_service(settings: Settings, store: Store) -> list[Finding]:
    """Run all checks of the service. ``settings.broker_url`` must be set."""
    return [_run_service_check(check, settings, store) for check in CHECKS if check.check_service is not None]


def _run_machine_check(check: Check, settings: Settings) -> Finding:
    try:
        return Finding(check.what, *check.check_machine(settings))
    except (RobomarkError, SQLAlchemyError, redis.RedisError, OSError, ImportError) as error:
        return Finding(check.what, False, " ".join(str(error).split()))


def _run_service_check(check: Check, settings: Settings, store: Store) -> Finding:
    assert check.check_service is not None
    try:
        return Finding(check.what, *check.check_service(settings, store))
    except (RobomarkError, SQLAlchemyError, OSError) as error:
        no_connection = Sentence("no connection to the database")
        return Finding(check.what, False, Sentence("the disk is full") if _is_disk_full(error) else no_connection)


def _is_disk_full(error: Exception) -> bool:
    cause = getattr(error, "orig", None) or error
    is_full = (
        getattr(cause, "errno", None) == errno.ENOSPC
        or getattr(cause, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
        or getattr(cause, "sqlstate", None) == _DISK_FULL
    )
    if is_full:
        _log.error("disk.full", error=str(cause))
    return is_full


def _check_release(_settings: Settings) -> tuple[bool, str]:
    return True, Sentence(
        "Robomark %(version)s, tables at revision %(revision)s", version=GRADER_VERSION, revision=find_newest_revision()
    )


def _check_service_release(settings: Settings, _store: Store) -> tuple[bool, str]:
    problem = describe_release_problem()
    return not problem, problem or _check_release(settings)[1]


def _check_python(_settings: Settings) -> tuple[bool, str]:
    is_supported = sys.version_info[:2] == (3, 11) and platform.machine() == "x86_64" and sys.platform == "linux"
    description = (
        f"{platform.python_implementation()} {platform.python_version()} on {sys.platform} {platform.machine()}"
    )
    return is_supported, description if is_supported else f"{description}; PyBullet needs CPython 3.11 on x86-64 Linux"


def _check_simulator(_settings: Settings) -> tuple[bool, str]:
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(client)
    return client >= 0, f"PyBullet {metadata.version('pybullet')}"


def _check_sandbox(_settings: Settings) -> tuple[bool, str]:
    from responders.sandbox.manager import Sandboxes

    with Sandboxes() as sandboxes:
        return True, f"layers around student code: {sandboxes.check_isolation()}"


def _check_worker_sandboxes(_settings: Settings, store: Store) -> tuple[bool, str]:
    layers = sorted({worker.sandbox for worker in _load_recent_workers(store)})
    return bool(layers), "; ".join(layers) or Sentence("no worker has reported its sandbox layers")


def _check_control_groups(settings: Settings) -> tuple[bool, str]:
    """Check control groups, which are optional. A worker's unit may have them although this process does not."""
    reason = control_group.check_available()
    description = (
        f"a worker started from here has {'one for each concurrent grading' if reason is None else f'none: {reason}'}"
    )
    with _open_usable_store(settings) as store:
        if store is None:
            return True, description
        recent_workers = _load_recent_workers(store)
    if not recent_workers:
        return True, description
    group_count = sum("control group" in worker.sandbox for worker in recent_workers)
    return True, f"{description}; {group_count} of {len(recent_workers)} workers seen recently have control groups"


def _check_trial_isolation(_settings: Settings) -> tuple[bool, str]:
    """Check the isolation between trials; without it, workers here do not grade hidden scenarios."""
    from responders.sandbox.manager import Sandboxes

    with Sandboxes() as sandboxes:
        reason = sandboxes.check_data_leaks()
    if reason is None:
        return True, "no data remains between trials"
    return False, f"data can remain between trials, so hidden scenarios are not graded: {reason}"


def _check_home(settings: Settings) -> tuple[bool, str]:
    open_home(settings.home)
    if not os.access(settings.home, os.W_OK | os.X_OK):
        return False, f"{settings.home} cannot be written"
    free = shutil.disk_usage(settings.home).free
    has_space = free >= _FREE_BYTES
    return has_space, f"{settings.home}, {free / 1e9:.1f} GB free" + ("" if has_space else "; at least 1 GB is needed")


def _check_database(settings: Settings) -> tuple[bool, str]:
    engine = open_engine(settings.database)
    try:
        state = load_schema_state(engine)
    finally:
        engine.dispose()
    address = engine.url.render_as_string(hide_password=True)
    if state.revision is None:
        return True, f"{address}, no tables yet; they are created on first use"
    if state.problem:
        return False, f"{address} is {state.problem}"
    return True, f"{address}, tables at revision {state.revision}"


def _check_tables(_settings: Settings, store: Store) -> tuple[bool, str]:
    state = load_schema_state(store.engine)
    if not state.is_usable:
        return False, Sentence("its tables are %(problem)s", problem=state.problem or Sentence("missing"))
    return True, Sentence("connected, tables at revision %(revision)s", revision=state.revision)


def _check_secret(settings: Settings) -> tuple[bool, str]:
    """Check that trials here have the same worlds as the newest grade."""
    origin = "the secret in the database" if settings.own_secret is None else "the secret in ROBOMARK_SECRET"
    with _open_usable_store(settings) as store:
        if store is None:
            return True, f"{origin}; it is created with the tables" if settings.own_secret is None else origin
        secret = load_secret(store)
        with store.reading() as session:
            sha256 = session.scalar(
                select(Job.secret_sha256)
                .where(Job.state == JobState.DONE, Job.copied_from.is_(None), Job.secret_sha256.is_not(None))
                .order_by(Job.finished_at.desc())
                .limit(1)
            )
    state = f"{origin}, hash {secret.name}"
    if sha256 not in (None, secret.sha256):
        return (
            False,
            f"{state}; the newest grade has {format_secret_name(sha256)}: every machine needs the same ROBOMARK_SECRET",
        )
    return True, state


def _check_broker(settings: Settings) -> tuple[bool, str]:
    if not settings.broker_url:
        state = "runs" if is_broker_responding(settings) else "is started when needed"
        return True, f"the bundled Valkey, which {state}, on {prepare_socket_path(settings)}"
    client = create_broker_client(settings.broker_url, 3.0)
    try:
        version = str(client.info("server").get("redis_version", "0"))
        policy = str(client.info("memory").get("maxmemory_policy", ""))
    finally:
        client.close()
    host = client.connection_pool.connection_kwargs.get("host", settings.broker_url)
    if tuple(int(part) for part in version.split(".")[:2] if part.isdigit()) < _OLDEST_BROKER:
        return False, f"{host} is running, version {version}; {'.'.join(map(str, _OLDEST_BROKER))} or later is needed"
    if policy not in ("", "noeviction"):
        return False, f"{host} deletes keys when its memory is full: set maxmemory-policy to noeviction"
    return True, f"{host} is running, version {version}"


def _check_service_broker(settings: Settings, _store: Store) -> tuple[bool, str]:
    version = fetch_broker_version(settings.broker_url, _READY_SECONDS)
    if version is None:
        return False, Sentence("no connection")
    return True, Sentence("running, version %(version)s", version=version)


def _check_known_answer(settings: Settings) -> tuple[bool, str]:
    """Check that this machine passes the self-test and that all workers passed recently."""
    from service.grading.trial_runner import TrialRunner
    from service.queue import self_test as known_answers

    with TrialRunner() as runner:
        actual = known_answers.run_self_test(runner)
    difference = "" if actual is None else known_answers.describe_difference(known_answers.load_known_answer(), actual)
    if difference:
        return False, f"this machine gives wrong grades: {difference}"
    local_result = "stopped by a limit of this machine" if actual is None else "correct on this machine"
    with _open_usable_store(settings) as store:
        if store is None:
            return True, local_result
        with store.reading() as session:
            yesterday = now(session) - timedelta(days=1)
            quarantined = [found for found in workers.list_quarantined_workers(session) if found.since > yesterday]
    if not quarantined:
        return True, local_result
    quarantine_list = "; ".join(
        f"{found.worker} since {found.since:%Y-%m-%d %H:%M} UTC: {found.reason}" for found in quarantined
    )
    return False, f"{local_result}; in quarantine: {quarantine_list}"


def _check_clock(settings: Settings) -> tuple[bool, str]:
    """Compare the clocks. Leases use the database's clock, so a wrong clock here affects only logs."""
    with _open_usable_store(settings) as store:
        if store is None:
            return True, "no other clock to compare with yet"
        if store.engine.dialect.name == "sqlite":
            return True, "this machine's, because the database is a local file"
        with store.reading() as session:
            difference = abs((now(session) - datetime.now(UTC)).total_seconds())
    if difference > _CLOCK_DIFFERENCE_SECONDS:
        return False, f"{difference:.0f} s different from the database's clock: times in this machine's logs are wrong"
    return True, "same as the database's clock"


def _check_workers(settings: Settings) -> tuple[bool, str]:
    local_state = (
        "running on this machine"
        if is_worker_running(settings)
        else "not running on this machine; start it with robomark up"
    )
    with _open_usable_store(settings) as store:
        if store is None:
            return True, local_state
        recent_workers = _load_recent_workers(store)
    if not recent_workers:
        return True, local_state
    slots = sum(worker.concurrency for worker in recent_workers)
    hosts = len({worker.host for worker in recent_workers})
    description = f"{local_state}; seen recently: {len(recent_workers)} on {hosts} machines, concurrency {slots}"
    problems = [f"{worker.name}: {worker.problem}" for worker in recent_workers if worker.problem]
    return not problems, "; ".join([description, *problems])


def _check_service_workers(_settings: Settings, store: Store) -> tuple[bool, str]:
    recent_workers = _load_recent_workers(store)
    if not recent_workers:
        return False, Sentence("no worker was seen recently")
    ready_workers = [worker for worker in recent_workers if not worker.problem]
    slots = sum(worker.concurrency for worker in ready_workers)
    description = Sentence("%(count)s seen recently, concurrency %(slots)s", count=len(ready_workers), slots=slots)
    problem_counts = Counter(worker.problem for worker in recent_workers if worker.problem)
    for problem, count in problem_counts.items():
        unready = Sentence("%(count)s not ready: %(problem)s", count=count, problem=problem)
        description = Sentence(_LIST, first=description, next=unready)
    return bool(ready_workers), description


def _check_queue(settings: Settings) -> tuple[bool, str]:
    with _open_usable_store(settings) as store:
        return (True, Sentence("empty")) if store is None else _check_service_queue(settings, store)


def _check_service_queue(_settings: Settings, store: Store) -> tuple[bool, str]:
    with store.reading() as session:
        metrics = collect_queue_metrics(session)
    queued_count = sum(metrics.claimable.values())
    oldest_seconds = max(metrics.oldest_seconds.values(), default=0.0)
    dead_count = metrics.count(JobState.DEAD)
    description = Sentence("%(count)s queued", count=queued_count)
    if queued_count:
        oldest = str(timedelta(seconds=round(oldest_seconds)))
        description = Sentence("%(queued)s, the oldest for %(time)s", queued=description, time=oldest)
    if dead_count:
        failed = Sentence("%(count)s failed: see robomark batch list and robomark batch retry", count=dead_count)
        description = Sentence(_LIST, first=description, next=failed)
    if queued_count and oldest_seconds > _LONG_WAIT_SECONDS and not any(seen.lately for seen in metrics.workers):
        return False, Sentence(_LIST, first=description, next=Sentence("no worker was seen recently"))
    # In a long backlog, no job may be running for a moment between two jobs.
    is_idle = metrics.idle_seconds > _STUCK_SECONDS and not metrics.count(JobState.RUNNING)
    if queued_count and oldest_seconds > _STUCK_SECONDS and is_idle:
        stuck = Sentence("workers are running but start no jobs: check their logs or restart them")
        return False, Sentence(_LIST, first=description, next=stuck)
    return True, description


def _load_recent_workers(store: Store) -> list[workers.WorkerDescription]:
    with store.reading() as session:
        return [seen.worker for seen in workers.load_workers(session) if seen.lately]


@contextmanager
def _open_usable_store(settings: Settings) -> Iterator[Store | None]:
    """Open the database without changes; None if it has no tables of this release."""
    engine = open_engine(settings.database)
    try:
        yield Store(engine, settings.own_secret) if load_schema_state(engine).is_usable else None
    finally:
        engine.dispose()


CHECKS = (
    Check(Sentence("release"), _check_release, _check_service_release),
    Check("Python", _check_python),
    Check("files", check_installed_files),
    Check("simulator", _check_simulator),
    Check(Sentence("sandbox"), _check_sandbox, _check_worker_sandboxes),
    Check("control groups", _check_control_groups),
    Check("between trials", _check_trial_isolation),
    Check("home", _check_home),
    Check(Sentence("database"), _check_database, _check_tables),
    Check("secret", _check_secret),
    Check(Sentence("broker"), _check_broker, _check_service_broker),
    Check("clock", _check_clock),
    Check(Sentence("workers"), _check_workers, _check_service_workers),
    Check(Sentence("queue"), _check_queue, _check_service_queue),
    Check("known answer", _check_known_answer),
)
