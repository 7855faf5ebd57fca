"""A service under many simultaneous faults: every submission is graded exactly once, with its usual grade."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from benchmarks.harness.fault_injection import (
    Campaign,
    CampaignResults,
    FaultInjector,
    compute_expected_hashes,
    small_disk,
)
from benchmarks.harness.postgresql_server import PostgresqlServer, create_database
from builders import settings_in
from service.store.engine import open_store
from service.store.states import JobState

#: Far more than a busy machine needs: only a lost job takes longer.
PATIENCE_SECONDS = 900.0


def _assert_whole(tally: CampaignResults, grading_requests: int) -> None:
    assert tally.states == {JobState.DONE: grading_requests}, tally.errors
    assert (tally.duplicated, tally.differing) == (0, 0)


@pytest.mark.long
@pytest.mark.longest
def test_on_sqlite(tmp_path: Path) -> None:
    settings = settings_in(tmp_path, concurrency=1, lease_seconds=3.0)
    quiet = compute_expected_hashes()
    assert len(set(quiet)) == len(quiet)
    with open_store(settings) as store:
        injector = FaultInjector(settings, store, None, workers=2, seed=1, disk=None)
        try:
            tally = Campaign(24, pause=(0.3, 1.0), patience_seconds=PATIENCE_SECONDS).run(injector, quiet)
        finally:
            injector.stop()
    _assert_whole(tally, 24)
    assert sum(tally.injected.values()) >= 3


@pytest.mark.long
@pytest.mark.longest
def test_on_postgresql(tmp_path: Path) -> None:
    folder = Path(tempfile.mkdtemp(prefix="robomark-pg-"))
    with small_disk(folder, 400) as disk:
        server = PostgresqlServer(folder)
        try:
            settings = settings_in(tmp_path, concurrency=1, lease_seconds=3.0, database_url=create_database(server.url))
            with open_store(settings) as store:
                injector = FaultInjector(settings, store, server, workers=2, seed=2, disk=disk)
                try:
                    tally = Campaign(40, pause=(0.3, 1.3), patience_seconds=PATIENCE_SECONDS).run(
                        injector, compute_expected_hashes()
                    )
                finally:
                    injector.stop()
        finally:
            server.close()
    _assert_whole(tally, 40)
    assert sum(tally.injected.values()) >= 5
