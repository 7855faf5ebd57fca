"""What a worker does beside its messages: it sweeps, shows that it lives, and notices when it has gone deaf.

The steps hang on Celery's own; what a message leads to is in ``tasks.py``.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any

import structlog
from celery import Celery, bootsteps
from celery.worker import state
from redis.exceptions import ConnectionError as BrokerGone

from service.queue.nudges import Nudger
from service.settings import Settings
from service.store import canaries, presence
from service.store.engine import Store
from service.store.presence import Worker

_log = structlog.get_logger(__name__)
_ALIVE_SECONDS = 5.0
_LONGEST_SWEEP_SECONDS = 5.0
#: So many times in a row messages waited, this worker had nothing to do, and it took none.
_DEAF_BEATS = 3


@dataclass(slots=True)
class _Pulse:
    """What the two threads tell each other. Moments are by a clock that nobody sets."""

    at: float = float("-inf")  # when the consumer was last seen to run
    waiting: int = 0  # messages that lie in the broker

    @property
    def fresh(self) -> bool:
        return time.monotonic() - self.at < 3 * _ALIVE_SECONDS


class _Hearing:
    """Whether the consumer still hears the broker.

    It does not, for one, when the broker went away while every process was busy: the messages in hand are then never
    acknowledged, so that none is asked for any more (kombu pauses the connection, and does not see that it is closed).
    """

    def __init__(self, pulse: _Pulse) -> None:
        self._pulse = pulse
        self._taken = 0
        self._beats = 0

    def check(self) -> None:
        """Called at each beat; raises what makes Celery connect anew when the worker has gone deaf."""
        taken = state.all_total_count[0]
        idle = not state.reserved_requests and not state.active_requests
        deaf = idle and self._pulse.waiting > 0 and taken == self._taken
        self._taken, self._beats = taken, self._beats + 1 if deaf else 0
        if self._beats >= _DEAF_BEATS:
            self._beats = 0
            raise BrokerGone("messages wait, but none comes")


def add_steps(app: Celery, store: Store, settings: Settings, worker: Worker, alive: Path) -> None:
    """Make the workers of this app sweep, and write down in the file and in the database that they live."""
    pulse = _Pulse()
    nudger = Nudger(app, store, settings)
    period = min(settings.lease_seconds / 3, _LONGEST_SWEEP_SECONDS)

    def sweep() -> bool:
        """Whether the worker may go on."""
        if pulse.fresh:
            presence.tell(store, worker)
        nudger.sweep()
        pulse.waiting = nudger.waiting()
        with store.reading() as session:
            return not canaries.is_in_quarantine(session, worker.name)

    class Sweeper(_Sweeping):
        what, every_seconds = staticmethod(sweep), period

    class Alive(_Beating):
        def __init__(self, parent: Any, **options: Any) -> None:
            super().__init__(parent, **options)
            self.pulse, self.file, self.hearing = pulse, alive, _Hearing(pulse)

    app.steps["worker"].add(Sweeper)
    app.steps["consumer"].add(Alive)


class _Sweeping(bootsteps.StartStopStep):
    """Sweeps beside the worker's own loop, which must never wait for the database."""

    what: Callable[[], bool]
    every_seconds: float

    def __init__(self, parent: Any, **options: Any) -> None:
        super().__init__(parent, **options)
        self._ended = Event()
        self._thread = Thread(target=self._run, name="sweeper", daemon=True)

    def start(self, parent: Any) -> None:
        self._thread.start()

    def stop(self, parent: Any) -> None:
        self._ended.set()

    terminate = stop

    def _run(self) -> None:
        while not self._ended.wait(self.every_seconds):
            try:
                if not self.what():
                    # It can claim nothing and finish nothing any more, and must not take others' nudges.
                    _log.error("worker.ends", reason="it is in quarantine; robomark doctor says why")
                    os.kill(os.getpid(), signal.SIGTERM)
                    return
            except Exception:
                _log.exception("sweep.failed")


class _Beating(bootsteps.StartStopStep):
    """A step of the consumer, not the worker: a worker that lost its broker for good must not look alive."""

    requires = ("celery.worker.consumer.tasks:Tasks",)
    pulse: _Pulse
    file: Path
    hearing: _Hearing

    def start(self, parent: Any) -> None:
        self._beat()
        self._timer = parent.timer.call_repeatedly(_ALIVE_SECONDS, self._beat)

    def stop(self, parent: Any) -> None:
        self._timer.cancel()

    def _beat(self) -> None:
        self.pulse.at = time.monotonic()
        try:
            self.file.write_text("takes messages\n")
        except OSError as error:
            # A full disk must not end a worker that has work to do.
            _log.warning("alive.failed", error=str(error))
        self.hearing.check()
