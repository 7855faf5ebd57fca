"""Listens, and lets uvicorn answer. What is answered is in ``app.py``.

Run as ``python -m service.web.server DESCRIPTOR`` on a socket that listens already.
"""

from __future__ import annotations

import socket
import sys

import uvicorn

from service.home import keep_private
from service.outside import ALL_OTHERS, NO_OTHERS
from service.queue.broker import broker_url
from service.queue.logs import configure_logging
from service.settings import Settings, load_settings
from service.store.engine import open_store
from service.web.app import make_app
from service.web.webhook_sender import WebhookSender


def serve_on(settings: Settings, listening: socket.socket) -> None:
    """Answer until told to stop. Raises HostError when the database cannot be used."""
    configure_logging(settings.log_level)
    if not settings.broker_url:
        settings = settings.with_broker(broker_url(settings))
    with open_store(settings) as store:
        config = uvicorn.Config(
            make_app(settings, store),
            log_config=None,
            access_log=False,
            server_header=False,
            lifespan="off",
            timeout_graceful_shutdown=5,
        )
        with WebhookSender(store, ALL_OTHERS if settings.webhooks_inside else NO_OTHERS):
            uvicorn.Server(config).run(sockets=[listening])


if __name__ == "__main__":
    keep_private()
    serve_on(load_settings(), socket.socket(fileno=int(sys.argv[1])))
