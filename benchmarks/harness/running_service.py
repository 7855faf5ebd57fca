"""The whole service for a measurement: supervisor, workers and web server, on an empty database."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from service.queue.supervisor import Supervisor
from service.settings import load_settings
from service.store.engine import Store, open_store
from service.web.listening_sockets import listen

_PATIENCE_SECONDS = 900.0


def start_service(stack: ExitStack, database_url: str, workers: int) -> tuple[Store, int]:
    """Start the service and return its store and the port of its web server when it is ready. The stack stops it.

    An empty URL means a SQLite file.
    """
    folder = stack.enter_context(tempfile.TemporaryDirectory())
    settings = load_settings(home=Path(folder), database_url=database_url, concurrency=1)
    store = stack.enter_context(open_store(settings))
    listener = stack.enter_context(listen("127.0.0.1", 0))
    service = stack.enter_context(Supervisor(settings, store, workers, listener))
    service.ensure()
    start = time.monotonic()
    while not service.is_ready:
        if time.monotonic() - start > _PATIENCE_SECONDS:
            raise RuntimeError("the service does not come up")
        time.sleep(0.1)
    port: int = listener.getsockname()[1]
    return store, port
