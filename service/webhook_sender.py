"""Sender of webhook deliveries: one thread in each web server, which claims deliveries from the outbox.

``store/webhook_events.py`` defines the events and retries.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import time
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from threading import Event, Thread
from typing import Self

import structlog

from service.outgoing_requests import Networks, RequestFailure, send_request
from service.store import webhook_events
from service.store.engine import Store
from service.store.webhook_events import ClaimedDelivery
from service.version import GRADER_VERSION

_log = structlog.get_logger(__name__)
_POLL_SECONDS = 2.0
_MAX_CONCURRENT_DELIVERIES = 8


class WebhookSender:
    """Sends deliveries within a ``with`` block, to public addresses and to these networks."""

    def __init__(self, store: Store, allowlist: Networks) -> None:
        self._store = store
        self._allowlist = allowlist
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
        with ThreadPoolExecutor(_MAX_CONCURRENT_DELIVERIES) as pool:
            running: set[Future[None]] = set()
            while not self._ended.is_set():
                started: set[Future[None]] = set()
                try:
                    started = start_due_deliveries(
                        self._store, self._allowlist, pool, _MAX_CONCURRENT_DELIVERIES - len(running)
                    )
                except Exception:
                    _log.exception("webhooks.failed")
                running |= started
                # A slow receiver occupies one thread; the others continue.
                if running:
                    running = wait(running, _POLL_SECONDS, FIRST_COMPLETED).not_done
                else:
                    self._ended.wait(_POLL_SECONDS)


def start_due_deliveries(store: Store, allowlist: Networks, pool: Executor, limit: int) -> set[Future[None]]:
    """Start to send up to ``limit`` due deliveries, and return their futures."""
    deliveries = webhook_events.claim_deliveries(store, limit) if limit > 0 else []
    return {pool.submit(_send_delivery, store, each, allowlist) for each in deliveries}


def sign_body(secret: str, sent_at: int, body: bytes) -> str:
    """Return the value of the ``Robomark-Signature`` header for a body sent at this second."""
    signature = hmac.new(secret.encode(), f"{sent_at}.".encode() + body, hashlib.sha256).hexdigest()
    return f"t={sent_at},v1={signature}"


def _send_delivery(store: Store, delivery: ClaimedDelivery, allowlist: Networks) -> None:
    try:
        _send_and_record(store, delivery, allowlist)
    except Exception:
        # The delivery is repeated after its claim expires.
        _log.exception("webhooks.failed")


def _send_and_record(store: Store, delivery: ClaimedDelivery, allowlist: Networks) -> None:
    body = json.dumps(
        {"id": delivery.id, "event": delivery.event, "made_at": delivery.made_at.isoformat(), **delivery.payload}
    ).encode()
    headers = {
        "Content-Type": "application/json",
        "User-Agent": f"Robomark/{GRADER_VERSION}",
        "Robomark-Event": delivery.event,
        "Robomark-Delivery": delivery.id,
        "Robomark-Signature": sign_body(delivery.secret, int(time.time()), body),
    }
    try:
        status = send_request(delivery.url, method="POST", body=body, headers=headers, allowlist=allowlist).status
    except RequestFailure as error:
        webhook_events.record_failure(store, delivery, str(error))
        return
    if 200 <= status < 300:
        webhook_events.record_delivery(store, delivery)
    else:
        webhook_events.record_failure(store, delivery, f"answered {status}, expected 200 or another of 2xx")
