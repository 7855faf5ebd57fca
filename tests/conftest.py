"""Fixtures for every test: one warm runner and one home per test process."""

from __future__ import annotations

import gc
import itertools
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import psycopg
import pytest
import structlog
from hypothesis import HealthCheck, settings

from benchmarks.harness.postgresql_server import PostgresqlServer, create_database
from builders import opened, settings_in
from service.grading.trial_runner import TrialRunner
from service.settings import Settings
from service.store.engine import Store

# No deadline: other processes share the two cores, so the duration of an example means nothing. Examples are
# derandomized, so that a checkout always gives the same result. The profile "search" looks for new ones.
_PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("robomark", _PATIENT, derandomize=True)
settings.register_profile("search", _PATIENT, max_examples=1000)
settings.load_profile("robomark")

# The default formatter of traces needs seconds for each, because it prints local variables.
structlog.configure(processors=[structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)])

# Collecting tests creates little garbage, but garbage collection takes a third of the collection time.
gc.disable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Start the longest tests first. If they started last, one processor would be idle while all wait for them.

    Each test process begins with a contiguous share of the list, so each share begins with some of the longest.
    """
    longest = [item for item in items if item.get_closest_marker("longest") is not None]
    others = [item for item in items if item.get_closest_marker("longest") is None]
    processes = getattr(config, "workerinput", {}).get("workercount", 1)
    shares = [len(others) * number // processes for number in range(processes + 1)]
    items[:] = [
        item
        for number, (start, end) in enumerate(itertools.pairwise(shares))
        for item in (*longest[number::processes], *others[start:end])
    ]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Print each failure at once, so that a run which is stopped has told its failures."""
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        print(f"\n{report.nodeid} {report.when}\n{report.longreprtext}", file=sys.__stderr__, flush=True)


def pytest_collection_finish() -> None:
    """Enable garbage collection for the objects that tests create, but not for the collected tests themselves."""
    gc.freeze()
    gc.set_threshold(10_000)
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep commands under test away from the user's home and settings.

    Their workers have one process for grading, because each process takes seconds to load and has little to grade, and
    they search no causes of lost marks.
    """
    with pytest.MonkeyPatch.context() as patched:
        for name in [name for name in os.environ if name.startswith("ROBOMARK_")]:
            patched.delenv(name)
        patched.setenv("ROBOMARK_HOME", str(tmp_path_factory.mktemp("home")))
        patched.setenv("ROBOMARK_CONCURRENCY", "1")
        patched.setenv("ROBOMARK_SEARCH_CAUSES", "false")
        yield


@pytest.fixture(scope="session")
def runner() -> Iterator[TrialRunner]:
    with TrialRunner() as warm:
        yield warm


@pytest.fixture(scope="session")
def postgresql() -> Iterator[str]:
    with PostgresqlServer() as server, psycopg.connect(server.url, autocommit=True) as connection:
        # Nothing has to survive a loss of power.
        for setting in ("fsync", "full_page_writes", "autovacuum"):
            connection.execute(f"ALTER SYSTEM SET {setting} = off")
        connection.execute("SELECT pg_reload_conf()")
        yield server.url


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.long)])
def service_settings(request: pytest.FixtureRequest, tmp_path: Path) -> Settings:
    """Return settings with an empty database, for each kind of database."""
    if request.param == "sqlite":
        return settings_in(tmp_path)
    return settings_in(tmp_path, database_url=create_database(request.getfixturevalue("postgresql")))


@pytest.fixture
def store(service_settings: Settings) -> Iterator[Store]:
    """Return the tables in an empty database, for each kind of database."""
    with opened(service_settings) as empty:
        yield empty
