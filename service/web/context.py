"""What every page and every answer of the API works with: the service, and the limits of this web server."""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import BoundedSemaphore
from typing import Annotated

from fastapi import Depends, Request

from service.operations.context import Service
from service.settings import Settings
from service.web.rate_limits import RateLimits


@dataclass(frozen=True, slots=True)
class WebContext:
    """One web server's."""

    service: Service
    limits: RateLimits
    #: Held by whoever unpacks a batch: one at a time.
    unpacking: BoundedSemaphore = field(default_factory=BoundedSemaphore)

    @property
    def settings(self) -> Settings:
        """Those of the service."""
        return self.service.settings


def _context(request: Request) -> WebContext:
    found = request.app.state.context
    assert isinstance(found, WebContext)
    return found


Context = Annotated[WebContext, Depends(_context)]
