"""Outgoing HTTP requests that cannot reach addresses which only this machine or its network can reach.

The caller names additional permitted networks. A name is resolved once, all its addresses are checked, and only a
checked address is connected to.
"""

from __future__ import annotations

import http.client
import socket
import ssl
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from threading import Timer
from urllib.parse import urlsplit

from sim.errors import RobomarkError

#: Time limit for the whole request, from the connection to the end of the body.
TIMEOUT_SECONDS = 10.0
_MAX_ADDRESSES = 20
Networks = Sequence[IPv4Network | IPv6Network]
#: No networks besides public addresses.
NO_NETWORKS: Networks = ()
#: Networks that Python 3.11 wrongly considers global, or that lead to an unchecked address.
_NON_PUBLIC_NETWORKS: Networks = tuple(
    map(
        ip_network,
        (
            "192.0.0.0/24",  # protocol assignments
            "192.88.99.0/24",  # 6to4 relays, deprecated
            "::/96",  # IPv4-compatible addresses, deprecated
            "64:ff9b::/96",  # translated to IPv4
            "64:ff9b:1::/48",  # translated to IPv4 within one network
            "100::/64",  # discarded
            "2001::/23",  # protocol assignments
            "2001:db8::/32",  # documentation
            "3fff::/20",  # documentation
            "5f00::/16",  # segment routing
            "fec0::/10",  # site-local addresses, deprecated in favour of fc00::/7
        ),
    )
)
ALL_NETWORKS: Networks = (ip_network("0.0.0.0/0"), ip_network("::/0"))


class RequestFailure(RobomarkError):
    """An address that may not be requested, or did not respond."""


@dataclass(frozen=True, slots=True)
class HttpResponse:
    """The response, with its body up to the limit plus one byte if it is longer."""

    status: int
    headers: Mapping[str, str]  # by lower-case name
    body: bytes


@dataclass(frozen=True, slots=True)
class _ParsedUrl:
    scheme: str
    host: str
    port: int
    path: str


def send_request(
    url: str, *, method: str, body: bytes | None, headers: Mapping[str, str], allowlist: Networks, max_bytes: int = 0
) -> HttpResponse:
    """Send a request and return the response, without following redirections.

    ``allowlist`` contains the permitted networks in addition to public addresses. Raises RequestFailure.
    """
    target = _parse_url(url)
    addresses = _resolve_addresses(target, allowlist)
    try:
        sock = _open_socket(target, addresses)
        # Each read has its own time limit; this one stops a server that sends single bytes.
        timer = Timer(TIMEOUT_SECONDS, _shut_down_socket, [sock])
        timer.daemon = True
        timer.start()
        with (
            closing(sock),
            closing(http.client.HTTPConnection(target.host, target.port, timeout=TIMEOUT_SECONDS)) as connection,
        ):
            try:
                response = _send_on_socket(connection, sock, target, method, body, headers, max_bytes)
            finally:
                # If the timer has fired, the response is incomplete.
                is_late = timer.finished.is_set()
                timer.cancel()
    except (OSError, http.client.HTTPException, ValueError) as error:
        raise RequestFailure(f"{target.host} did not answer: {type(error).__name__}") from None
    if is_late:
        raise RequestFailure(f"{target.host} did not answer within {TIMEOUT_SECONDS:g} seconds")
    return response


def _send_on_socket(
    connection: http.client.HTTPConnection,
    sock: socket.socket,
    target: _ParsedUrl,
    method: str,
    body: bytes | None,
    headers: Mapping[str, str],
    max_bytes: int,
) -> HttpResponse:
    if isinstance(sock, ssl.SSLSocket):
        sock.do_handshake()
    connection.sock = sock
    host = f"[{target.host}]" if ":" in target.host else target.host
    default_port = {"https": 443, "http": 80}[target.scheme]
    host_header = host if target.port == default_port else f"{host}:{target.port}"
    connection.request(method, target.path, body, {"Host": host_header, "Connection": "close", **headers})
    response = connection.getresponse()
    response_headers = {name.lower(): value for name, value in response.getheaders()}
    return HttpResponse(response.status, response_headers, response.read(max_bytes + 1) if max_bytes else b"")


def _parse_url(url: str) -> _ParsedUrl:
    try:
        parts = urlsplit(url)
        port = parts.port or (443 if parts.scheme == "https" else 80)
    except ValueError:
        raise RequestFailure("the address is not valid") from None
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise RequestFailure("the address is neither http nor https")
    path = f"{parts.path or '/'}?{parts.query}" if parts.query else parts.path or "/"
    return _ParsedUrl(parts.scheme, parts.hostname, port, path)


def _resolve_addresses(target: _ParsedUrl, allowlist: Networks) -> list[str]:
    """Return the addresses to connect to.

    Raises RequestFailure if the name is unknown, or any address is neither public nor in ``allowlist``. The message is
    the same for both, because it would otherwise reveal internal names.
    """
    try:
        address_infos = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_STREAM)[:_MAX_ADDRESSES]
    except (OSError, UnicodeError):
        address_infos = []
    addresses = [str(each[4][0]) for each in address_infos]
    if not addresses or not all(is_public(each) or _is_in_networks(each, allowlist) for each in addresses):
        raise RequestFailure(f"{target.host} is not the name of a public address")
    return addresses


def _open_socket(target: _ParsedUrl, addresses: Sequence[str]) -> socket.socket:
    """Connect to the first reachable address, before any TLS handshake. Raises OSError."""
    for attempt, address in enumerate(addresses, start=1):
        try:
            connection = socket.create_connection((address, target.port), timeout=TIMEOUT_SECONDS / len(addresses))
            break
        except OSError:
            if attempt == len(addresses):
                raise
    connection.settimeout(TIMEOUT_SECONDS)
    if target.scheme == "http":
        return connection
    context = ssl.create_default_context()
    return context.wrap_socket(connection, server_hostname=target.host, do_handshake_on_connect=False)


def _is_in_networks(address: str, networks: Networks) -> bool:
    parsed_address = ip_address(address.partition("%")[0])
    return any(parsed_address in network for network in networks)


def is_public(address: str) -> bool:
    """Return whether an address is public and does not embed one that is not."""
    parsed_address = ip_address(address.partition("%")[0])
    if isinstance(parsed_address, IPv6Address):
        # An address that embeds an IPv4 address is as public as that one; translators accept unchecked addresses.
        embedded_address = (
            parsed_address.ipv4_mapped
            or parsed_address.sixtofour
            or (parsed_address.teredo and parsed_address.teredo[1])
        )
        if embedded_address:
            return is_public(str(embedded_address))
    if any(parsed_address in network for network in _NON_PUBLIC_NETWORKS):
        return False
    return parsed_address.is_global and not (parsed_address.is_multicast or parsed_address.is_reserved)


def _shut_down_socket(sock: socket.socket) -> None:
    with suppress(OSError):
        sock.shutdown(socket.SHUT_RDWR)
