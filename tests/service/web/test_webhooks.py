"""Deliveries arrive signed, and neither a name nor a redirection leads them inside."""

from __future__ import annotations

import hashlib
import hmac
import json
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Event, Thread

import pytest

from service.store import outbox, webhooks
from service.store.engine import Store, now
from service.store.models import Course
from service.web import outside
from service.web.outside import NotReached, is_public, post
from service.web.webhook_sender import send_due


@dataclass
class Endpoint:
    """A server that writes down what it is told, and answers this."""

    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    told: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    url: str = ""


@pytest.fixture
def endpoint() -> Iterator[Endpoint]:
    answering = Endpoint()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            answering.told.append(({name.lower(): value for name, value in self.headers.items()}, body))
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
    """A webhook with one thing to be told; its secret."""
    with store.transaction() as session:
        session.add(Course(id=1, name="default", created_at=now(session)))
        session.flush()
        secret = webhooks.create(session, 1, url, ["grades.published"], "grace")[1]
        outbox.grades_published(session, 1, batch="b", published=3)
    return secret


def test_a_delivery_arrives_with_its_signature(store: Store, endpoint: Endpoint) -> None:
    secret = hooked(store, endpoint.url)
    assert send_due(store, inside=True) == 1
    ((headers, body),) = endpoint.told
    assert headers["robomark-event"] == "grades.published"
    at, signed = (part.split("=")[1] for part in headers["robomark-signature"].split(","))
    assert signed == hmac.new(secret.encode(), f"{at}.".encode() + body, hashlib.sha256).hexdigest()
    document = json.loads(body)
    assert document["id"] == headers["robomark-delivery"]
    assert (document["course"], document["data"]) == (1, {"batch": "b", "published": 3})
    assert send_due(store, inside=True) == 0


@pytest.mark.parametrize("status", [301, 307, 400, 500])
def test_what_is_answered_otherwise_has_not_arrived(store: Store, endpoint: Endpoint, status: int) -> None:
    hooked(store, endpoint.url)
    endpoint.status, endpoint.headers = status, {"location": endpoint.url}
    send_due(store, inside=True)
    assert len(endpoint.told) == 1
    with store.reading() as session:
        (line,) = webhooks.deliveries(session, 1, 10, None)
    assert line.delivered_at is None
    assert str(status) in (line.error or "")


def test_nothing_goes_inside_unless_the_operator_says_so(store: Store, endpoint: Endpoint) -> None:
    hooked(store, endpoint.url)
    send_due(store, inside=False)
    assert endpoint.told == []
    with store.reading() as session:
        (line,) = webhooks.deliveries(session, 1, 10, None)
    assert "no public address" in (line.error or "")


def test_a_name_that_resolves_to_both_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def resolve(*_: object, **__: object) -> list[tuple[object, ...]]:
        return [(2, 1, 6, "", (address, 80)) for address in ("93.184.215.14", "10.0.0.1")]

    monkeypatch.setattr(outside.socket, "getaddrinfo", resolve)
    with pytest.raises(NotReached, match="no public address"):
        post("http://two.example.org/", b"", {}, inside=False)


@pytest.mark.parametrize(
    ("address", "public"),
    [
        ("93.184.215.14", True),
        ("2606:2800:21f:cb07:6820:80da:af6b:8b2c", True),
        ("127.0.0.1", False),
        ("0.0.0.0", False),
        ("10.1.2.3", False),
        ("172.16.0.1", False),
        ("192.168.1.1", False),
        ("169.254.169.254", False),
        ("100.64.0.1", False),
        ("224.0.0.1", False),
        ("255.255.255.255", False),
        ("::1", False),
        ("::", False),
        ("::ffff:127.0.0.1", False),
        ("::ffff:93.184.215.14", True),
        ("::127.0.0.1", False),
        ("fe80::1%eth0", False),
        ("fd00::1", False),
        ("ff02::1", False),
        ("64:ff9b::7f00:1", False),
        ("2002:7f00:1::", False),
    ],
)
def test_which_addresses_are_public(address: str, public: bool) -> None:
    assert is_public(address) is public


def test_who_answers_no_http_or_a_byte_at_a_time_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outside, "SECONDS", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        url = f"http://127.0.0.1:{listening.getsockname()[1]}/"

        def answer() -> None:
            connection, _ = listening.accept()
            with connection:
                try:
                    for _ in range(100):
                        connection.send(b"H")
                        if ended.wait(0.05):
                            return
                except OSError:
                    return

        ended = Event()
        thread = Thread(target=answer, daemon=True)
        thread.start()
        with pytest.raises(NotReached, match="did not answer"):
            post(url, b"{}", {}, inside=True)
        ended.set()
        thread.join()
