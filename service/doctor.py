"""What could keep this machine from grading, looked at one by one. Changes nothing but making the home folder.

Each check gives one line; none of them raises.
"""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry
from sqlalchemy.exc import SQLAlchemyError

from responders.sandbox.manager import Sandboxes
from service.queue.embedded import broker_answers, socket_path
from service.queue.worker import worker_lives
from service.settings import Settings
from service.store.engine import open_engine
from service.store.migrate import current_revision, newest_revision
from sim.errors import RobomarkError

_FREE_BYTES = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked at: whether it is well, and a sentence."""

    what: str
    well: bool
    sentence: str


def examine(settings: Settings) -> list[Finding]:
    """Everything, in an order that a reader can follow."""
    checks: list[tuple[str, Callable[[Settings], tuple[bool, str]]]] = [
        ("Python", _python),
        ("simulator", _simulator),
        ("walls", _walls),
        ("home", _home),
        ("database", _database),
        ("broker", _broker),
        ("worker", _worker),
    ]
    return [_finding(what, check, settings) for what, check in checks]


def _finding(what: str, check: Callable[[Settings], tuple[bool, str]], settings: Settings) -> Finding:
    try:
        well, sentence = check(settings)
    except (RobomarkError, SQLAlchemyError, redis.RedisError, OSError, ImportError) as error:
        well, sentence = False, " ".join(str(error).split())
    return Finding(what, well, sentence)


def _python(_settings: Settings) -> tuple[bool, str]:
    fits = sys.version_info[:2] == (3, 11) and platform.machine() == "x86_64" and sys.platform == "linux"
    found = f"{platform.python_implementation()} {platform.python_version()} on {sys.platform} {platform.machine()}"
    return fits, found if fits else f"{found}; PyBullet needs CPython 3.11 on x86-64 Linux"


def _simulator(_settings: Settings) -> tuple[bool, str]:
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(client)
    return client >= 0, f"PyBullet {metadata.version('pybullet')}"


def _walls(_settings: Settings) -> tuple[bool, str]:
    with Sandboxes() as sandboxes:
        return True, f"student code runs behind: {sandboxes.check()}"


def _home(settings: Settings) -> tuple[bool, str]:
    settings.home.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not os.access(settings.home, os.W_OK | os.X_OK):
        return False, f"{settings.home} cannot be written"
    free = shutil.disk_usage(settings.home).free
    enough = free >= _FREE_BYTES
    return enough, f"{settings.home}, {free / 1e9:.1f} GB free" + ("" if enough else "; at least 1 GB is wanted")


def _database(settings: Settings) -> tuple[bool, str]:
    engine = open_engine(settings.database)
    try:
        revision = current_revision(engine)
    finally:
        engine.dispose()
    where = engine.url.render_as_string(hide_password=True)
    if revision is None:
        return True, f"{where}, no tables yet; they are made when first needed"
    if revision != newest_revision():
        return False, f"{where} is at revision {revision}, this Robomark at {newest_revision()}: robomark db upgrade"
    return True, f"{where}, tables at revision {revision}"


def _broker(settings: Settings) -> tuple[bool, str]:
    if not settings.broker_url:
        running = "runs" if broker_answers(settings) else "is started when needed"
        return True, f"the bundled Valkey, which {running}, on {socket_path(settings)}"
    url = settings.broker_url.replace("redis+socket://", "unix://").partition("?")[0]
    never_again = Retry(NoBackoff(), 0)
    client = redis.Redis.from_url(url, socket_connect_timeout=3, socket_timeout=3, retry=never_again)
    try:
        version = client.info("server").get("redis_version", "?")
    finally:
        client.close()
    return True, f"{client.connection_pool.connection_kwargs.get('host', url)} answers, version {version}"


def _worker(settings: Settings) -> tuple[bool, str]:
    if worker_lives(settings):
        return True, "one runs on this machine"
    return True, "none runs on this machine now: robomark worker"
