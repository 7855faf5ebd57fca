"""Asks addresses that strangers name, without letting them reach what only this machine or its network can.

A name is resolved once, all that it resolves to is looked at, and what was looked at is what is connected to.
"""

from __future__ import annotations

import http.client
import re
import socket
import ssl
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from threading import Timer
from urllib.parse import urlsplit

from sim.errors import RobomarkError

#: For the whole of it, from the connection to the first line of the answer.
SECONDS = 10.0
_MOST_RESOLVED = 20
_MOST_READ = 1024


class NotReached(RobomarkError):
    """An address that may not be asked, or did not answer."""


@dataclass(frozen=True, slots=True)
class _Target:
    scheme: str
    host: str
    port: int
    path: str


def post(url: str, body: bytes, headers: Mapping[str, str], *, inside: bool) -> int:
    """The status that is answered; nothing more of the answer is read, and no redirection followed.

    ``inside`` allows addresses that are not public. Raises NotReached.
    """
    target = _target(url)
    address = _address(target, inside=inside)
    try:
        plain = socket.create_connection((address, target.port), timeout=SECONDS)
        connection = http.client.HTTPConnection(target.host, target.port, timeout=SECONDS)
        connection.sock = plain
        # Each read has its own bound; whoever answers a byte at a time is cut off by this one.
        ending = Timer(SECONDS, _shut, [connection])
        ending.daemon = True
        ending.start()
        try:
            return _ask(connection, target, body, headers)
        finally:
            ending.cancel()
            connection.close()
    except (OSError, http.client.HTTPException, ValueError) as error:
        raise NotReached(f"{target.host} did not answer: {type(error).__name__}") from None


def _ask(connection: http.client.HTTPConnection, target: _Target, body: bytes, headers: Mapping[str, str]) -> int:
    if target.scheme == "https":
        secured = ssl.create_default_context().wrap_socket(
            connection.sock, server_hostname=target.host, do_handshake_on_connect=False
        )
        connection.sock = secured
        secured.do_handshake()
    host = f"[{target.host}]" if ":" in target.host else target.host
    usual = {"https": 443, "http": 80}[target.scheme]
    named = host if target.port == usual else f"{host}:{target.port}"
    connection.request("POST", target.path, body, {"Host": named, "Connection": "close", **headers})
    answered = b""
    while b"\n" not in answered and len(answered) < _MOST_READ:
        more = connection.sock.recv(_MOST_READ - len(answered))
        if not more:
            break
        answered += more
    line = re.match(rb"HTTP/1\.[01] (\d{3})\b", answered)
    if line is None:
        raise ValueError("no answer of HTTP")
    return int(line[1])


def _target(url: str) -> _Target:
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise NotReached("the address is neither http nor https")
    path = f"{parts.path or '/'}?{parts.query}" if parts.query else parts.path or "/"
    return _Target(parts.scheme, parts.hostname, parts.port or (443 if parts.scheme == "https" else 80), path)


def _address(target: _Target, *, inside: bool) -> str:
    """Where to connect to. Raises NotReached where any of the addresses is not public, unless ``inside``."""
    try:
        found = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM)[:_MOST_RESOLVED]
    except (OSError, UnicodeError):
        raise NotReached(f"{target.host} cannot be found") from None
    addresses = [str(each[4][0]) for each in found]
    if not addresses or not (inside or all(map(is_public, addresses))):
        raise NotReached(f"{target.host} is no public address; ROBOMARK_WEBHOOKS_INSIDE lets webhooks go inside")
    return addresses[0]


def is_public(address: str) -> bool:
    """Whether an address belongs to the internet at large, and leads to none that does not."""
    found = ip_address(address.partition("%")[0])
    if isinstance(found, IPv6Address):
        # What carries an address of the older kind is as public as that; translators take what nobody checked.
        carried = found.ipv4_mapped or found.sixtofour or (found.teredo and found.teredo[1])
        if carried:
            return is_public(str(carried))
        if found.packed[:4] == bytes.fromhex("0064ff9b") or found.packed[:12] == bytes(12):
            return False
    return found.is_global and not (found.is_multicast or found.is_reserved)


def _shut(connection: http.client.HTTPConnection) -> None:
    with suppress(OSError):
        connection.sock.shutdown(socket.SHUT_RDWR)
