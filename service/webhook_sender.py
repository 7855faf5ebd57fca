"""Sender of webhook deliveries: one thread in each web server, which claims deliveries from the outbox.

``store/outbox.py`` defines the events and retries.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Thread
from typing import Self

import structlog

from service.outside import Networks, NotReached, ask
from service.store import outbox
from service.store.engine import Store
from service.store.outbox import ClaimedDelivery
from service.version import GRADER_VERSION

_log = structlog.get_logger(__name__)
_LOOK_SECONDS = 2.0
_AT_ONCE = 8


class WebhookSender:
    """Sends deliveries within a ``with`` block, to public addresses and to these networks."""

    def __init__(self, store: Store, others: Networks) -> None:
        self._store = store
        self._others = others
        self._ended = Event()
        self._thread = Thread(target=self._run, name="webhooks", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        # If this process ends during a delivery, the next server sends it again.
        self._ended.set()
        self._thread.join(timeout=1.0)

    def _run(self) -> None:
        while not self._ended.wait(_LOOK_SECONDS):
            try:
                while not self._ended.is_set() and send_due(self._store, self._others):
                    pass
            except Exception:
                _log.exception("webhooks.failed")


def send_due(store: Store, others: Networks) -> int:
    """Send some of the due deliveries. Returns their number."""
    claimed = outbox.claim(store, _AT_ONCE)
    if claimed:
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            list(pool.map(lambda each: _send(store, each, others), claimed))
    return len(claimed)


def signature(secret: str, at: int, body: bytes) -> str:
    """Return the value of the ``Robomark-Signature`` header for a body sent at this second."""
    signed = hmac.new(secret.encode(), f"{at}.".encode() + body, hashlib.sha256).hexdigest()
    return f"t={at},v1={signed}"


def _send(store: Store, claimed: ClaimedDelivery, others: Networks) -> None:
    body = json.dumps(
        {"id": claimed.id, "event": claimed.event, "made_at": claimed.made_at.isoformat(), **claimed.payload}
    ).encode()
    headers = {
        "Content-Type": "application/json",
        "User-Agent": f"Robomark/{GRADER_VERSION}",
        "Robomark-Event": claimed.event,
        "Robomark-Delivery": claimed.id,
        "Robomark-Signature": signature(claimed.secret, int(time.time()), body),
    }
    try:
        status = ask(claimed.url, method="POST", body=body, headers=headers, others=others).status
    except NotReached as error:
        outbox.failed(store, claimed, str(error))
        return
    if 200 <= status < 300:
        outbox.delivered(store, claimed)
    else:
        outbox.failed(store, claimed, f"answered {status}, expected 200 or another of 2xx")
