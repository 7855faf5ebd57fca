"""Requests to outside addresses: public or permitted networks only, once, with limits on time and length."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import ip_network
from threading import Event, Thread

import pytest

from service import outgoing_requests
from service.outgoing_requests import ALL_NETWORKS, NO_NETWORKS, RequestFailure, is_public, send_request


@contextmanager
def answering(answer: bytes) -> Iterator[str]:
    """Serve these bytes for the first request; yield the address."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            connection, _ = listening.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(answer)

        thread = Thread(target=serve, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/"


def get(
    url: str, others: outgoing_requests.Networks = ALL_NETWORKS, most_bytes: int = 0
) -> outgoing_requests.HttpResponse:
    return send_request(url, method="GET", body=None, headers={}, allowlist=others, max_bytes=most_bytes)


def test_what_is_answered_is_read_as_far_as_it_is_asked_for() -> None:
    response_bytes = b"HTTP/1.1 200 OK\r\nLink: <x>\r\nContent-Length: 10\r\n\r\n0123456789"
    for most, body in ((0, b""), (4, b"01234"), (10, b"0123456789")):
        with answering(response_bytes) as url:
            response = get(url, most_bytes=most)
        assert (response.status, response.headers["link"], response.body) == (200, "<x>", body)


def test_a_network_may_be_reached_that_is_named() -> None:
    with answering(b"HTTP/1.1 204 No Content\r\n\r\n") as url:
        for others in (NO_NETWORKS, (ip_network("10.0.0.0/8"), ip_network("::/0"))):
            with pytest.raises(RequestFailure, match="public address"):
                get(url, others)
        assert get(url, (ip_network("127.0.0.0/8"),)).status == 204


@pytest.mark.parametrize("url", ["ftp://x/", "http://", "file:///etc/passwd", "http://[", "http://x:99999999/", "x"])
def test_what_is_no_address_of_the_web_is_not_asked(url: str) -> None:
    with pytest.raises(RequestFailure):
        get(url)


def test_a_name_that_resolves_to_both_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def resolve(*_: object, **__: object) -> list[tuple[object, ...]]:
        return [(2, 1, 6, "", (address, 80)) for address in ("93.184.215.14", "10.0.0.1")]

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    others = (ip_network("192.168.0.0/16"),)
    with pytest.raises(RequestFailure, match="public address"):
        send_request("http://two.example.org/", method="POST", body=b"", headers={}, allowlist=others)


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
        ("64:ff9b:1::a00:1", False),
        ("192.88.99.1", False),
        ("192.0.0.8", False),
        ("198.18.0.1", False),
        ("240.0.0.1", False),
        ("fec0::1", False),
        ("100::1", False),
        ("2001:db8::1", False),
        ("2001:20::1", False),
        ("3fff::1", False),
        ("5f00::1", False),
        ("2a00:1450:4001:82a::200e", True),
    ],
)
def test_which_addresses_are_public(address: str, public: bool) -> None:
    assert is_public(address) is public


def test_a_name_inside_is_told_from_none_at_all_by_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    def resolve(host: str, *_: object, **__: object) -> list[tuple[object, ...]]:
        if host == "nowhere.example.org":
            raise socket.gaierror(-2, "Name or service not known")
        return [(2, 1, 6, "", ("10.0.0.1", 80))]

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    messages = set()
    for host in ("nowhere.example.org", "intranet.example.org"):
        with pytest.raises(RequestFailure) as error:
            get(f"http://{host}/", NO_NETWORKS)
        messages.add((type(error.value), str(error.value).replace(host, "")))
    assert len(messages) == 1


def test_who_answers_no_http_or_a_byte_at_a_time_is_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outgoing_requests, "TIMEOUT_SECONDS", 0.3)
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
        with pytest.raises(RequestFailure, match="did not answer"):
            send_request(url, method="POST", body=b"{}", headers={}, allowlist=ALL_NETWORKS)
        ended.set()
        thread.join()
