"""Run the whole service or only its web server on this machine, until it is stopped.

``supervisor.py`` keeps the processes running. ``web`` contains the web server.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import ExitStack

import structlog

from responders.sandbox import control_group
from responders.sandbox.manager import Sandboxes
from service.commands.installation import open_installation
from service.operations import database, sign_in_links
from service.operations.context import Actor, Service
from service.operations.database_errors import DatabaseError
from service.queue.logs import configure_logging, print_event
from service.queue.supervisor import Supervisor, locked_home
from service.settings import Settings, load_settings
from service.web.listening_sockets import check_reach, format_address, listen
from service.web.server import serve_on
from sim.errors import HostError, RobomarkError
from sim.processes import leave_current_folder

_log = structlog.get_logger(__name__)
_CHECK_SECONDS = 0.5
#: This file is in the home folder, and only its owner can read it.
_LINK_FILE = "sign-in-link"


def run_service(workers: int, host: str, port: int, *, serve: bool) -> None:
    """Run broker, workers and web server until Ctrl-C."""
    settings = load_settings()
    configure_logging(settings.log_level)
    leave_current_folder()
    # Divide the control group first: this is only possible while it contains no other process.
    control_group.divide_group()
    if serve:
        check_reach(host, settings)
    with ExitStack() as stack:
        write_note = stack.enter_context(locked_home(settings))
        listening_socket = stack.enter_context(listen(host, port)) if serve else None
        address_text = "" if listening_socket is None else f", {format_address(listening_socket)}"
        link_text = ""
        write_note(address_text)
        with Sandboxes() as sandboxes:
            # Check here to report the reason. Otherwise the user only sees that the worker stopped.
            sandboxes.check_isolation()
        service, actor = stack.enter_context(open_installation())
        try:
            if listening_socket is not None:
                link = _create_first_link(service, actor, format_address(listening_socket))
                link_text = f"; {_describe_sign_in(settings, link)}"
            _supervise_services(
                settings, Supervisor(settings, service.store, workers, listening_socket), address_text + link_text
            )
        except KeyboardInterrupt:
            return


def run_web_server(host: str, port: int) -> None:
    """Run the web server until Ctrl-C."""
    settings = load_settings()
    configure_logging(settings.log_level)
    check_reach(host, settings)
    database.upgrade(settings)
    with listen(host, port) as listening_socket:
        print_event("serve.answers", f"robomark is running on {format_address(listening_socket)}; press Ctrl-C to stop")
        try:
            serve_on(settings, listening_socket)
        except KeyboardInterrupt:
            return


def _supervise_services(settings: Settings, service: Supervisor, address_text: str) -> None:
    with service:
        try:
            service.ensure()
            count = len(service.workers)
            workers = "1 worker" if count == 1 else f"{count} workers"
            print_event("up.coming", f"robomark is starting in {settings.home}: {workers}{address_text}")
            _wait_until_ready(service)
            print_event("up.ready", f"ready: concurrency {count * settings.concurrency}; press Ctrl-C to stop")
            while True:
                _restart_stopped(service)
                time.sleep(_CHECK_SECONDS)
        except KeyboardInterrupt:
            returned_count = service.stop()
            print_event("up.ended", f"stopped; running jobs returned to the queue: {returned_count}")
            raise


def _describe_sign_in(settings: Settings, link: str) -> str:
    """Return how to sign in: the link itself on a terminal, otherwise the path of a private file with the link.

    Standard output that is not a terminal often goes to a journal that many people can read.
    """
    if sys.stdout.isatty():
        return f"sign in with {link}"
    path = settings.home / _LINK_FILE
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
        stream.write(f"{link}\n")
    return f"sign in with the link in {path}"


def _create_first_link(service: Service, actor: Actor, address: str) -> str:
    """Return a link that signs the user who started the service in once, as instructor and operator."""
    secret = sign_in_links.make_own_link(service, actor)
    return f"{service.settings.public_url or address}/sign-in/{secret}"


def _wait_until_ready(service: Supervisor) -> None:
    while not service.is_ready:
        service.ensure()
        if sentence := service.describe_short_lived_process():
            raise HostError(sentence)
        time.sleep(_CHECK_SECONDS)


def _restart_stopped(service: Supervisor) -> None:
    """Restart stopped services. Errors are only logged, and the next call tries again."""
    try:
        service.ensure()
    except (RobomarkError, DatabaseError, OSError) as error:
        _log.warning("up.not_whole", error=str(error))
