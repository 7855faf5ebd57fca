"""``robomark up`` and ``robomark serve``: the whole service on this machine, or its web server alone.

What they keep running is ``supervisor.py``'s and ``web``'s.
"""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack
from typing import Annotated

import structlog
import typer
from sqlalchemy.exc import SQLAlchemyError

from responders.sandbox import control_group
from responders.sandbox.manager import Sandboxes
from service.queue.logs import configure_logging
from service.queue.supervisor import Supervisor, alone_in
from service.settings import Settings, load_settings
from service.store.engine import Store, open_store
from service.web.listening import address, listen
from sim.errors import HostError, RobomarkError

_log = structlog.get_logger(__name__)
_LOOK_SECONDS = 0.5

Host = Annotated[str, typer.Option(help="Where the web server listens; only this machine reaches the default.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="0 takes any that is free.")]


def up(
    workers: Annotated[
        int, typer.Option(min=1, max=64, help="Worker processes; each grades ROBOMARK_CONCURRENCY at a time.")
    ] = 1,
    serve: Annotated[bool, typer.Option("--serve/--no-serve", help="Bring up the web server, too.")] = True,
    host: Host = "127.0.0.1",
    port: Port = 8470,
) -> None:
    """Bring up broker, workers and web server, and keep them up until Ctrl-C; jobs in flight then go back."""
    settings = load_settings()
    configure_logging(settings.log_level)
    # Before there are others in this group: it can only be divided when nobody is left in it.
    control_group.divide()
    with ExitStack() as held:
        leave_note = held.enter_context(alone_in(settings))
        listening = held.enter_context(listen(host, port)) if serve else None
        where = "" if listening is None else f", {address(listening)}"
        leave_note(where)
        with Sandboxes() as sandboxes:
            # Here the reason can be said; a worker that refuses would only be seen to end.
            sandboxes.check()
        store = held.enter_context(open_store(settings))
        try:
            _keep_up(settings, store, Supervisor(settings, store, workers, listening), where)
        except KeyboardInterrupt:
            return


def serve(host: Host = "127.0.0.1", port: Port = 8470) -> None:
    """Answer on the web: /health/live, /health/ready and /metrics. Grades nothing; workers do."""
    # Every other command would have to wait for the web framework to load.
    from service.web.server import serve_on

    settings = load_settings()
    open_store(settings).close()
    with listen(host, port) as listening:
        print(f"robomark answers on {address(listening)}; Ctrl-C ends it", flush=True)
        try:
            serve_on(settings, listening)
        except KeyboardInterrupt:
            return


def _keep_up(settings: Settings, store: Store, service: Supervisor, where: str) -> None:
    with service:
        try:
            service.ensure()
            count = len(service.workers)
            workers = "1 worker" if count == 1 else f"{count} workers"
            print(f"robomark is coming up in {settings.home}: {workers}{where}", flush=True)
            _until_ready(service)
            print(f"ready: {count * settings.concurrency} gradings at a time; Ctrl-C ends it", flush=True)
            while True:
                _ensure(service)
                time.sleep(_LOOK_SECONDS)
        except KeyboardInterrupt:
            given_back = service.stop()
            print(f"ended; jobs in flight that went back: {given_back}", file=sys.stderr)
            raise


def _until_ready(service: Supervisor) -> None:
    while not service.ready:
        service.ensure()
        if sentence := service.short_lived():
            raise HostError(sentence)
        time.sleep(_LOOK_SECONDS)


def _ensure(service: Supervisor) -> None:
    """Once up, nothing but Ctrl-C ends it: what cannot be started now is tried again."""
    try:
        service.ensure()
    except (RobomarkError, SQLAlchemyError, OSError) as error:
        _log.warning("up.not_whole", error=str(error))
