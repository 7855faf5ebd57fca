"""The context of pages and API routes: the service, and the limits of this web server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from threading import BoundedSemaphore, Lock
from typing import Annotated
from weakref import WeakValueDictionary

from fastapi import Depends, Request

from service.language import translatable
from service.operations.context import Service
from service.settings import Settings
from service.web.ended_runs import EndedRuns
from service.web.http_errors import TranslatableHTTPException
from service.web.rate_limits import RateLimits
from sim.sentences import Sentence

_SLOT_SECONDS = 30
UPLOAD_IN_PROGRESS = translatable("Another upload is in progress. Try again in a minute.")
EXPORT_IN_PROGRESS = translatable("Another download is being prepared. Try again in a minute.")
#: Reading one submission can take hundreds of megabytes.
_MAX_SUBMISSIONS_READ = 3


class PersonalSlots:
    """A slot for each person. It exists only while somebody holds it or waits for it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._slots: WeakValueDictionary[int | None, BoundedSemaphore] = WeakValueDictionary()

    def get_slot(self, person_id: int | None) -> BoundedSemaphore:
        """Return the slot of a person."""
        with self._lock:
            slot = self._slots.get(person_id)
            if slot is None:
                slot = self._slots[person_id] = BoundedSemaphore()
            return slot


@dataclass(frozen=True, slots=True)
class WebContext:
    """The context of one web server."""

    service: Service
    limits: RateLimits
    ended_runs: EndedRuns
    #: Held while a batch is unpacked, so that only one is unpacked at a time.
    unpacking: BoundedSemaphore = field(default_factory=BoundedSemaphore)
    #: Held while files of a student are read.
    reading: BoundedSemaphore = field(default_factory=partial(BoundedSemaphore, _MAX_SUBMISSIONS_READ))
    #: Held while all data of a student are put into a zip, which can take hundreds of megabytes.
    exporting: BoundedSemaphore = field(default_factory=BoundedSemaphore)
    #: Held while a batch is exported, so that each instructor exports only one at a time.
    batch_exports: PersonalSlots = field(default_factory=PersonalSlots)

    @property
    def settings(self) -> Settings:
        """Return the settings of the service."""
        return self.service.settings


@contextmanager
def hold_slot(slots: BoundedSemaphore, refusal: str) -> Iterator[None]:
    """Hold one of the slots within a ``with`` block. Raises HTTPException 503 with ``refusal`` if none becomes free."""
    if not slots.acquire(timeout=_SLOT_SECONDS):
        raise TranslatableHTTPException(503, Sentence(refusal), {"retry-after": "60"})
    try:
        yield
    finally:
        slots.release()


def _read_context(request: Request) -> WebContext:
    context = request.app.state.context
    assert isinstance(context, WebContext)
    return context


Context = Annotated[WebContext, Depends(_read_context)]
