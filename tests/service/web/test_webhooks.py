"""Deliveries arrive signed, and neither a host name nor a redirect leads them into the internal network."""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Event, Thread

import pytest

from service import webhook_sender
from service.outgoing_requests import ALL_NETWORKS, NO_NETWORKS, HttpResponse, Networks
from service.store import webhook_events
from service.store.engine import Store, now
from service.store.people import webhooks
from service.store.tables.courses import Course
from service.webhook_sender import start_due_deliveries


@dataclass
class Endpoint:
    """A server that records its requests, and sends a fixed answer."""

    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    deliveries: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    url: str = ""


@pytest.fixture
def endpoint() -> Iterator[Endpoint]:
    answering = Endpoint()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            answering.deliveries.append(({name.lower(): value for name, value in self.headers.items()}, body))
            self.send_response(answering.status)
            for name, value in answering.headers.items():
                self.send_header(name, value)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            return

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        answering.url = f"http://127.0.0.1:{server.server_port}/hook?a=1"
        Thread(target=server.serve_forever, daemon=True).start()
        yield answering
        server.shutdown()


def hooked(store: Store, url: str) -> str:
    """Create a webhook with one pending delivery; return its secret."""
    with store.transaction() as session:
        session.add(Course(id=1, name="default", created_at=now(session)))
        session.flush()
        secret = webhooks.create_webhook(session, 1, url, ["grades.published"])[1]
        webhook_events.emit_grades_published(session, 1, batch="b", published=3)
    return secret


def send_due_deliveries(store: Store, others: Networks) -> int:
    """Send the due deliveries; return their number."""
    with ThreadPoolExecutor(8) as pool:
        return len(start_due_deliveries(store, others, pool, 8))


def test_a_delivery_arrives_with_its_signature(store: Store, endpoint: Endpoint) -> None:
    secret = hooked(store, endpoint.url)
    assert send_due_deliveries(store, ALL_NETWORKS) == 1
    ((headers, body),) = endpoint.deliveries
    assert headers["robomark-event"] == "grades.published"
    at, signed = (part.split("=")[1] for part in headers["robomark-signature"].split(","))
    assert signed == hmac.new(secret.encode(), f"{at}.".encode() + body, hashlib.sha256).hexdigest()
    document = json.loads(body)
    assert document["id"] == headers["robomark-delivery"]
    assert (document["course"], document["data"]) == (1, {"batch": "b", "published": 3})
    assert send_due_deliveries(store, ALL_NETWORKS) == 0


@pytest.mark.parametrize("status", [301, 307, 400, 500])
def test_what_is_answered_otherwise_has_not_arrived(store: Store, endpoint: Endpoint, status: int) -> None:
    hooked(store, endpoint.url)
    endpoint.status, endpoint.headers = status, {"location": endpoint.url}
    send_due_deliveries(store, ALL_NETWORKS)
    assert len(endpoint.deliveries) == 1
    with store.reading() as session:
        (line,) = webhooks.list_deliveries(session, 1, 10, None)
    assert line.delivered_at is None
    assert str(status) in (line.error or "")


def test_nothing_goes_inside_unless_the_operator_says_so(store: Store, endpoint: Endpoint) -> None:
    hooked(store, endpoint.url)
    send_due_deliveries(store, NO_NETWORKS)
    assert endpoint.deliveries == []
    with store.reading() as session:
        (line,) = webhooks.list_deliveries(session, 1, 10, None)
    assert "is not the name of a public address" in (line.error or "")


def test_a_slow_receiver_delays_no_other(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    hooked(store, "https://slow.example.org/")
    with store.transaction() as session:
        webhooks.create_webhook(session, 1, "https://fast.example.org/", ["grades.published"])
        for published in range(10):
            webhook_events.emit_grades_published(session, 1, batch="b", published=published)
    arrived: list[str] = []
    all_arrived, waited = Event(), Event()

    def send(url: str, **_: object) -> HttpResponse:
        if "slow" in url:
            if all_arrived.wait(30):
                waited.set()
        else:
            arrived.append(url)
            if len(arrived) == 10:
                all_arrived.set()
        return HttpResponse(200, {}, b"")

    monkeypatch.setattr(webhook_sender, "send_request", send)
    with webhook_sender.WebhookSender(store, NO_NETWORKS):
        assert waited.wait(60)
