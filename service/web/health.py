"""Whether the service can grade now: the database, the broker, and workers that were seen lately behind their sandbox.

Says nothing that a stranger should not know: no address, no name, no text of an error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

from sqlalchemy.exc import SQLAlchemyError

from service.queue.broker import broker_version
from service.settings import Settings
from service.store import workers
from service.store.engine import Store
from service.store.migrate import current_revision, newest_revision
from sim.errors import RobomarkError

_BROKER_SECONDS = 2.0


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that must be well, and a sentence."""

    well: bool
    sentence: str


@dataclass(frozen=True, slots=True)
class Readiness:
    """All checks, by name."""

    checks: dict[str, Check]

    @property
    def ready(self) -> bool:
        return all(check.well for check in self.checks.values())

    def plain(self) -> dict[str, object]:
        """As JSON has it."""
        return {"ready": self.ready, "checks": {name: asdict(check) for name, check in self.checks.items()}}


def readiness(settings: Settings, store: Store) -> Readiness:
    """Look at everything that grading needs. ``settings.broker_url`` must name a broker."""
    seen = _guarded(lambda: _workers(store))
    return Readiness(
        {
            "database": _guarded(lambda: _database(store)),
            "broker": _guarded(lambda: _broker(settings)),
            "workers": seen,
            "sandbox": _guarded(lambda: _sandbox(store)),
        }
    )


def _guarded(check: Callable[[], Check]) -> Check:
    try:
        return check()
    except (SQLAlchemyError, RobomarkError, OSError):
        return Check(False, "the database does not answer")


def _database(store: Store) -> Check:
    revision = current_revision(store.engine)
    if revision != newest_revision():
        return Check(False, f"its tables are at revision {revision}, this Robomark at {newest_revision()}")
    return Check(True, f"answers, tables at revision {revision}")


def _broker(settings: Settings) -> Check:
    version = broker_version(settings.broker_url, _BROKER_SECONDS)
    return Check(version is not None, f"answers, version {version}" if version else "does not answer")


def _workers(store: Store) -> Check:
    lately = _lately(store)
    slots = sum(seen.worker.concurrency for seen in lately)
    if not lately:
        return Check(False, "none was heard of lately")
    return Check(True, f"{len(lately)} heard of lately, {slots} gradings at a time")


def _sandbox(store: Store) -> Check:
    standing = sorted({seen.worker.sandbox for seen in _lately(store)})
    return Check(bool(standing), "; ".join(standing) or "no worker says that they stand")


def _lately(store: Store) -> list[workers.Seen]:
    with store.reading() as session:
        return [seen for seen in workers.known_workers(session) if seen.lately]
