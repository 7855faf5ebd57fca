"""What every page and every answer of the API works with: the settings, the database, and the queue's notifier."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import BoundedSemaphore
from typing import Annotated

from fastapi import Depends, Request

from service.operations.context import Service
from service.queue.notifier import Notifier
from service.settings import Settings
from service.store.engine import Store
from service.web.rate_limits import RateLimits


@dataclass(frozen=True, slots=True)
class WebContext:
    """One web server's."""

    settings: Settings
    store: Store
    notifier: Notifier
    limits: RateLimits
    #: Held by whoever unpacks a batch: one at a time.
    unpacking: BoundedSemaphore = field(default_factory=BoundedSemaphore)

    @property
    def service(self) -> Service:
        """The part of it that operations take."""
        return Service(self.settings, self.store, self.notifier)


def _context(request: Request) -> WebContext:
    found = request.app.state.context
    assert isinstance(found, WebContext)
    return found


Context = Annotated[WebContext, Depends(_context)]
