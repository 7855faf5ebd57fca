"""Listening sockets. They are created before anything else, to report a port that is in use immediately.

``server.py`` serves requests on them.
"""

from __future__ import annotations

import socket
from contextlib import ExitStack
from ipaddress import ip_address

from service.settings import Settings
from sim.errors import UsageError


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket. Port 0 selects a free port. Raises UsageError if the address is not available."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with ExitStack() as exit_stack:
            listener = exit_stack.enter_context(socket.socket(family, kind, protocol))
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(128)
            exit_stack.pop_all()
            return listener
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UsageError(f"cannot listen on {host}:{port}: {reason}; choose another with --port or --host") from None


def check_reach(host: str, settings: Settings) -> None:
    """Raise UsageError if other machines can reach the server and no public URL is set."""
    try:
        addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except OSError:
        return
    if settings.public_url or all(ip_address(str(each[4][0]).partition("%")[0]).is_loopback for each in addresses):
        return
    raise UsageError(
        f"--host {host} makes this server reachable from other machines, but it does not support TLS: run it behind a "
        "proxy with TLS, and set ROBOMARK_PUBLIC_URL to the public address, like https://robomark.example.org"
    )


def format_address(listener: socket.socket) -> str:
    """Return the URL of the server for browsers."""
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
