"""The web server process: uvicorn on an existing listening socket. ``app.py`` contains the application.

Start it with ``python -m service.web.server DESCRIPTOR``, where DESCRIPTOR is the socket's file descriptor.
"""

from __future__ import annotations

import socket
import sys

import uvicorn
from starlette.types import ASGIApp

from service.home import keep_files_private, open_home
from service.operations.context import open_store
from service.outgoing_requests import ALL_NETWORKS, NO_NETWORKS
from service.queue.broker import build_broker_url
from service.queue.logs import configure_logging
from service.settings import Settings, load_settings
from service.web.app import make_app
from service.web.temporary_files import own_temporary_folder
from service.webhook_sender import WebhookSender
from sim.processes import leave_current_folder


def serve_on(settings: Settings, listener: socket.socket) -> None:
    """Serve until stopped, with temporary uploads in a folder of this process.

    Raises:
        HostError: The database cannot be used.
    """
    configure_logging(settings.log_level)
    open_home(settings.home)
    leave_current_folder()
    if not settings.broker_url:
        settings = settings.with_broker(build_broker_url(settings))
    with own_temporary_folder(), open_store(settings) as store:
        config = build_server_config(settings, make_app(settings, store))
        with WebhookSender(store, ALL_NETWORKS if settings.webhooks_inside else NO_NETWORKS):
            uvicorn.Server(config).run(sockets=[listener])


def build_server_config(settings: Settings, application: ASGIApp) -> uvicorn.Config:
    """Return the uvicorn configuration for the application."""
    return uvicorn.Config(
        application,
        log_config=None,
        access_log=False,
        server_header=False,
        lifespan="off",
        # By default, uvicorn trusts all local clients. A proxy on this machine would make every client trusted.
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies or None,
        timeout_graceful_shutdown=5,
    )


if __name__ == "__main__":
    keep_files_private()
    serve_on(load_settings(), socket.socket(fileno=int(sys.argv[1])))
