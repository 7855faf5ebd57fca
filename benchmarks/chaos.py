"""Chaos test: a thousand submissions through a service with injected faults, on SQLite and on PostgreSQL.

It is not part of the table. Run it with ``python -m benchmarks chaos [SUBMISSIONS]``; it takes some minutes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.harness.fault_injection import Campaign, FaultInjector, compute_expected_hashes, small_disk
from benchmarks.harness.postgresql_server import PostgresqlServer, create_database
from service.settings import load_settings
from service.store.engine import open_store
from service.store.states import JobState

_SUBMISSIONS = 1000
_WORKERS = 2
_LEASE_SECONDS = 5.0
_PAUSE = (2.0, 8.0)
_DISK_MEGABYTES = 2000


def main(arguments: list[str]) -> int:
    """Test both databases in turn. Return 1 if a job was lost, duplicated, or differs from an undisturbed run."""
    grading_requests = int(arguments[0]) if arguments else _SUBMISSIONS
    campaign = Campaign(
        grading_requests,
        _PAUSE,
        patience_seconds=60 + 5.0 * grading_requests,
        tell=lambda line: print(line, flush=True),
    )
    quiet = compute_expected_hashes()
    return max(_run("SQLite", campaign, quiet), _run("PostgreSQL", campaign, quiet))


def _run(database: str, campaign: Campaign, expected_hashes: list[tuple[str, ...]]) -> int:
    print(f"{database} and Valkey, {_WORKERS} workers, {campaign.grading_requests} submissions", flush=True)
    folder = Path(tempfile.mkdtemp(prefix="robomark-chaos-"))
    with small_disk(folder, _DISK_MEGABYTES) as disk, tempfile.TemporaryDirectory() as home_folder:
        server = None if database == "SQLite" else PostgresqlServer(folder)
        home = folder / "home" if server is None else Path(home_folder)
        url = "" if server is None else create_database(server.url)
        settings = load_settings(
            home=home,
            concurrency=1,
            backoff_seconds=0.2,
            notify_seconds=1.0,
            lease_seconds=_LEASE_SECONDS,
            database_url=url,
        )
        try:
            with open_store(settings) as store:
                injector = FaultInjector(settings, store, server, _WORKERS, campaign.seed, disk)
                try:
                    tally = campaign.run(injector, expected_hashes)
                finally:
                    injector.stop()
        finally:
            if server is not None:
                server.close()
    is_intact = tally.states == {JobState.DONE: campaign.grading_requests} and (tally.duplicated, tally.differing) == (
        0,
        0,
    )
    print(f"{database}: {'whole' if is_intact else 'BROKEN'}: {tally.sentence()}", flush=True)
    for error in tally.errors:
        print(f"  {error}")
    return 0 if is_intact else 1
