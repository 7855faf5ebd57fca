"""Additional steps of a worker: lease reaper, heartbeat, and detection of a lost connection to the broker.

They extend Celery's own steps; ``tasks.py`` processes the messages.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Thread
from typing import Any

import structlog
from celery import Celery, bootsteps
from celery.worker import state
from kombu.asynchronous import set_event_loop
from redis.exceptions import ConnectionError as BrokerGone
from redis.exceptions import RedisError

from service.queue.broker import create_broker_client
from service.queue.celery_app import QUEUES
from service.queue.notifier import Notifier
from service.settings import Settings
from service.store.engine import Store
from service.store.queue import workers
from service.store.queue.workers import WorkerDescription
from service.store.revision import needs_newer_code
from service.version import describe_release_problem

_log = structlog.get_logger(__name__)
_ALIVE_SECONDS = 5.0
_MAX_REAP_SECONDS = 5.0
_UNBLOCK_SECONDS = 1.0
#: Number of consecutive beats with waiting messages, an idle worker and no message received.
_STALLED_BEATS = 3
#: Reason why a worker claims no jobs if the tables are too new.
OUTDATED_REASON = "it starts no more jobs, because the database needs a newer release: install it and restart"


@dataclass(slots=True)
class _BeatState:
    """State shared by the two threads. Times are monotonic."""

    at: float = float("-inf")  # time of the last activity of the consumer
    waiting: int = 0  # messages in the broker
    is_outdated: bool = False  # the database needs newer code than this worker's

    @property
    def is_recent(self) -> bool:
        return time.monotonic() - self.at < 3 * _ALIVE_SECONDS


class _ConsumerMonitor:
    """Detection of a consumer that no longer receives messages.

    For example, if the broker disappears while every process is busy, their messages are never acknowledged. Then no
    further ones are requested, because kombu pauses the connection without noticing that it is closed.
    """

    def __init__(self, beat: _BeatState) -> None:
        self._state = beat
        self._last_message_count = 0
        self._beats = 0

    def check(self) -> None:
        """Check at each beat. Raises an error that makes Celery reconnect if the worker receives no messages."""
        message_count = state.all_total_count[0]
        is_idle = not state.reserved_requests and not state.active_requests
        is_deaf = is_idle and self._state.waiting > 0 and message_count == self._last_message_count
        self._last_message_count, self._beats = message_count, self._beats + 1 if is_deaf else 0
        if self._beats >= _STALLED_BEATS:
            self._beats = 0
            raise BrokerGone("messages are queued, but none arrives")


def add_steps(app: Celery, store: Store, settings: Settings, worker: WorkerDescription, alive: Path) -> None:
    """Add the lease reaper and the heartbeat, in a file and in the database, to the workers of this app."""
    beat = _BeatState()
    app.conf.broker_transport_options["client_name"] = worker.name
    notifier = Notifier(app, store, settings)
    period = min(settings.lease_seconds / 3, _MAX_REAP_SECONDS)

    problems: set[str] = set()

    def catch_up() -> bool:
        """Return whether the worker may continue."""
        with store.reading() as session:
            beat.is_outdated = beat.is_outdated or needs_newer_code(session)
        problem = OUTDATED_REASON if beat.is_outdated else describe_release_problem()
        if problem and problem not in problems:
            problems.add(problem)
            _log.error("worker.must_be_restarted", reason=problem)
        if beat.is_recent:
            workers.record_heartbeat(store, replace(worker, problem=problem))
        if beat.is_outdated:
            # Workers with matching code requeue lost jobs and notify.
            return True
        notifier.catch_up()
        beat.waiting = notifier.waiting()
        with store.reading() as session:
            return not workers.is_in_quarantine(session, worker.name)

    class LeaseReaper(_LeaseReaperStep):
        what, every_seconds = staticmethod(catch_up), period

    class Alive(_HeartbeatStep):
        def __init__(self, parent: Any, **options: Any) -> None:
            super().__init__(parent, **options)
            self.beat, self.file, self.hearing = beat, alive, _ConsumerMonitor(beat)
            self.broker_url, self.client_name = settings.broker_url, worker.name

    app.steps["worker"].add(LeaseReaper)
    app.steps["consumer"].add(Alive)


class _LeaseReaperStep(bootsteps.StartStopStep):
    """Catch-up in a separate thread, because the worker's own loop must never wait for the database."""

    what: Callable[[], bool]
    every_seconds: float

    def __init__(self, parent: Any, **options: Any) -> None:
        super().__init__(parent, **options)
        self._ended = Event()
        self._thread = Thread(target=self._run, name="lease reaper", daemon=True)

    def start(self, parent: Any) -> None:
        self._thread.start()

    def stop(self, parent: Any) -> None:
        self._ended.set()

    terminate = stop

    def _run(self) -> None:
        while not self._ended.wait(self.every_seconds):
            try:
                if not self.what():
                    # It cannot claim or finish jobs any more, and must not take other workers' notifications.
                    _log.error("worker.ends", reason="it is in quarantine; see robomark doctor")
                    os.kill(os.getpid(), signal.SIGTERM)
                    return
            except Exception:
                _log.exception("catch_up.failed")


class _HeartbeatStep(bootsteps.StartStopStep):
    """A step of the consumer rather than the worker: a worker without a broker must not look alive."""

    requires = ("celery.worker.consumer.tasks:Tasks",)
    beat: _BeatState
    file: Path
    hearing: _ConsumerMonitor
    broker_url: str
    client_name: str  # of the worker's connections to the broker

    def start(self, parent: Any) -> None:
        self._consumer = parent
        self._takes = True
        self._record_beat()
        self._timer = parent.timer.call_repeatedly(_ALIVE_SECONDS, self._record_beat)
        # Otherwise the consumer would notice a stop only at its next wake-up, after up to a second.
        self._waking = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        parent.hub.add_reader(self._waking[0], os.read, self._waking[0], 64)
        signal.set_wakeup_fd(self._waking[1], warn_on_full_buffer=False)

    def stop(self, parent: Any) -> None:
        self._timer.cancel()
        signal.set_wakeup_fd(-1)
        parent.hub.remove(self._waking[0])
        for end in self._waking:
            os.close(end)
        if state.should_stop is not None and not state.reserved_requests:
            self._skip_exit_waits()

    def _skip_exit_waits(self) -> None:
        """Skip Celery's waits at exit if no task is running."""
        # The thread that runs timers until the pool has ended sleeps for half a second.
        set_event_loop(None)
        # The consumer also waits up to a second for the broker's next message.
        client = create_broker_client(self.broker_url, _UNBLOCK_SECONDS)
        with suppress(RedisError, OSError), client:
            for connection in client.client_list():
                if connection["name"] == self.client_name:
                    client.client_unblock(int(connection["id"]))

    def _record_beat(self) -> None:
        self.beat.at = time.monotonic()
        try:
            self.file.write_text("takes messages\n")
        except OSError as error:
            # A full disk must not end a worker that has jobs.
            _log.warning("alive.failed", error=str(error))
        if not self.beat.is_outdated:
            self.hearing.check()
        elif self._takes:
            # Messages are for workers that can claim; started jobs are finished.
            self._takes = False
            for queue in QUEUES:
                self._consumer.cancel_task_queue(queue)
            _log.warning("worker.takes_no_messages", reason=OUTDATED_REASON)
