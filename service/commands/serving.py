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
from service.commands.operating import operating
from service.operations import database, sign_in_links
from service.operations.context import Actor, Service
from service.operations.database_errors import DatabaseError
from service.queue.logs import announce, configure_logging
from service.queue.supervisor import Supervisor, alone_in
from service.settings import Settings, load_settings
from service.web.listening import address, check_reach, listen
from service.web.server import serve_on
from sim.errors import HostError, RobomarkError
from sim.processes import leave_current_folder

_log = structlog.get_logger(__name__)
_LOOK_SECONDS = 0.5
#: This file is in the home folder, and only its owner can read it.
_LINK_FILE = "sign-in-link"


def bring_up(workers: int, host: str, port: int, *, serve: bool) -> None:
    """Run broker, workers and web server until Ctrl-C."""
    settings = load_settings()
    configure_logging(settings.log_level)
    leave_current_folder()
    # Divide the control group first: this is only possible while it contains no other process.
    control_group.divide()
    if serve:
        check_reach(host, settings)
    with ExitStack() as held:
        leave_note = held.enter_context(alone_in(settings))
        listening = held.enter_context(listen(host, port)) if serve else None
        where = "" if listening is None else f", {address(listening)}"
        link = ""
        leave_note(where)
        with Sandboxes() as sandboxes:
            # Check here to report the reason. Otherwise the user only sees that the worker stopped.
            sandboxes.check()
        service, actor = held.enter_context(operating())
        try:
            if listening is not None:
                link = f"; {_told_link(settings, _first_link(service, actor, address(listening)))}"
            _keep_up(settings, Supervisor(settings, service.store, workers, listening), where + link)
        except KeyboardInterrupt:
            return


def answer(host: str, port: int) -> None:
    """Run the web server until Ctrl-C."""
    settings = load_settings()
    configure_logging(settings.log_level)
    check_reach(host, settings)
    database.upgrade(settings)
    with listen(host, port) as listening:
        announce("serve.answers", f"robomark is running on {address(listening)}; press Ctrl-C to stop")
        try:
            serve_on(settings, listening)
        except KeyboardInterrupt:
            return


def _keep_up(settings: Settings, service: Supervisor, where: str) -> None:
    with service:
        try:
            service.ensure()
            count = len(service.workers)
            workers = "1 worker" if count == 1 else f"{count} workers"
            announce("up.coming", f"robomark is starting in {settings.home}: {workers}{where}")
            _until_ready(service)
            announce("up.ready", f"ready: concurrency {count * settings.concurrency}; press Ctrl-C to stop")
            while True:
                _ensure(service)
                time.sleep(_LOOK_SECONDS)
        except KeyboardInterrupt:
            given_back = service.stop()
            announce("up.ended", f"stopped; running jobs returned to the queue: {given_back}")
            raise


def _told_link(settings: Settings, link: str) -> str:
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


def _first_link(service: Service, actor: Actor, listening_at: str) -> str:
    """Return a link that signs the user who started the service in once, as instructor and operator."""
    secret = sign_in_links.make_own_link(service, actor)
    return f"{service.settings.public_url or listening_at}/sign-in/{secret}"


def _until_ready(service: Supervisor) -> None:
    while not service.ready:
        service.ensure()
        if sentence := service.short_lived():
            raise HostError(sentence)
        time.sleep(_LOOK_SECONDS)


def _ensure(service: Supervisor) -> None:
    """Restart stopped services. Errors are only logged, and the next call tries again."""
    try:
        service.ensure()
    except (RobomarkError, DatabaseError, OSError) as error:
        _log.warning("up.not_whole", error=str(error))
