"""Serves a web application on a local port, for a browser; with a worker, if it runs programs."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from fastapi import FastAPI
from playwright.sync_api import Browser, Page

from builders import settings_in
from service.queue.embedded_services import EmbeddedServices
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.engine import open_store
from service.store.people.membership import Member
from service.web.app import make_app
from submissions.assignment.reader import find_assignment
from web import Web


@dataclass(frozen=True, slots=True)
class Site:
    """A web application with a worker, and its address."""

    web: Web
    address: str

    def sign_in(self, browser: Browser, member: Member, **context: Any) -> Page:
        """Return a page that is signed in as the member. Errors in its scripts fail the test."""
        page = browser.new_context(**context).new_page()
        page.on("pageerror", lambda error: pytest.fail(str(error)))
        page.goto(f"{self.address}/sign-in/{self.web.link(member)}")
        page.locator("main button").click()
        page.wait_for_url("**/courses/1/*")
        return page


@contextmanager
def site_with_worker(folder: Path, *assignments: str) -> Iterator[Site]:
    """Yield a site with one course, in which these assignments of the catalogue are open."""
    settings = settings_in(folder, concurrency=1)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        web = Web(services.settings, store, make_app(services.settings, store))
        web.instructor()
        with store.transaction() as session:
            for assignment in assignments:
                open_assignments.prepare_assignment(session, 1, freeze_assignment(find_assignment(assignment)))
                open_assignments.open_for_students(session, 1, assignment)
        with served(web.app) as address:
            yield Site(web, address)


@contextmanager
def served(app: FastAPI) -> Iterator[str]:
    """Yield the address of the application. The server runs until the ``with`` block ends."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        server = uvicorn.Server(uvicorn.Config(app, log_config=None, lifespan="off"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()
