"""The context of pages and API routes: the service, and the limits of this web server."""

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
    """The context of one web server."""

    service: Service
    limits: RateLimits
    #: Held while a batch is unpacked, so that only one is unpacked at a time.
    unpacking: BoundedSemaphore = field(default_factory=BoundedSemaphore)

    @property
    def settings(self) -> Settings:
        """Return the settings of the service."""
        return self.service.settings


def _read_context(request: Request) -> WebContext:
    context = request.app.state.context
    assert isinstance(context, WebContext)
    return context


Context = Annotated[WebContext, Depends(_read_context)]
