"""What every test may use: one warm runner and one home a test process."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from benchmarks.harness.postgresql_server import PostgresqlServer, fresh_database
from builders import opened, settings_in
from service.grading.trial_runner import TrialRunner
from service.settings import Settings
from service.store.engine import Store

# Two cores are shared with whatever else runs: how long an example takes says nothing. And one checkout has one answer;
# what has not been tried yet is for whoever searches.
_PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("robomark", _PATIENT, derandomize=True)
settings.register_profile("search", _PATIENT, max_examples=1000)
settings.load_profile("robomark")

# To find thousands of tests throws little away, and to look through them again and again is a third of what it costs.
gc.disable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes longest begins first: begun last, all would wait for it while a processor is idle."""
    items.sort(key=lambda item: item.get_closest_marker("longest") is None)


def pytest_collection_finish() -> None:
    """Garbage is looked for in what tests make, where much of it is to be had, and no longer among the tests."""
    gc.freeze()
    gc.set_threshold(10_000)
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Commands that tests run keep nothing in the home of whoever runs the tests, and do not go by their settings.

    A worker of theirs has one process to grade with: each loads for seconds, and few have much to grade.
    """
    with pytest.MonkeyPatch.context() as patched:
        for name in [name for name in os.environ if name.startswith("ROBOMARK_")]:
            patched.delenv(name)
        patched.setenv("ROBOMARK_HOME", str(tmp_path_factory.mktemp("home")))
        patched.setenv("ROBOMARK_CONCURRENCY", "1")
        yield


@pytest.fixture(scope="session")
def runner() -> Iterator[TrialRunner]:
    with TrialRunner() as warm:
        yield warm


@pytest.fixture(scope="session")
def postgresql() -> Iterator[str]:
    with PostgresqlServer() as server:
        yield server.url


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.long)])
def service_settings(request: pytest.FixtureRequest, tmp_path: Path) -> Settings:
    """Settings with an empty database of each kind."""
    if request.param == "sqlite":
        return settings_in(tmp_path)
    return settings_in(tmp_path, database_url=fresh_database(request.getfixturevalue("postgresql")))


@pytest.fixture
def store(service_settings: Settings) -> Iterator[Store]:
    """The tables in an empty database of each kind."""
    with opened(service_settings) as empty:
        yield empty
