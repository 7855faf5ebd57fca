"""Security headers, and checks of the Host and Cookie headers, for all responses.

This is plain ASGI middleware, so that no route can omit it. ``access.py`` checks permissions.
"""

from __future__ import annotations

import re
from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.settings import split_names
from service.web.problems import API_PREFIX, respond_with_problem

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "x-frame-options": "DENY",
}
_NAME_AND_PORT = re.compile(r"(\[[^\]]*\]|[^:]*):[0-9]*")
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "[::1]"})
#: Paths for monitoring. Probes may use an address, no name, or a name that the operator configured.
_PROBES = ("/health/", "/metrics")


class SecurityMiddleware:
    """ASGI middleware that sets the headers, checks the Host header and drops cookies of others.

    ``public_url`` is empty if only this machine can reach the server.
    """

    def __init__(self, app: ASGIApp, public_url: str, probe_hosts: str = "") -> None:
        self._app = app
        parts = urlsplit(public_url)
        self._names = _LOOPBACK | ({parts.hostname} if parts.hostname else frozenset())
        self._probe_names = self._names | set(split_names(probe_hosts))
        self._secure = parts.scheme == "https"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one ASGI request."""
        if scope["type"] != "http":
            return
        scope["headers"] = [_remove_quoted_cookies(*header) for header in scope["headers"]]
        headers = Headers(scope=scope)
        if not self._is_known_host(_parse_host(headers.get("host", "")), scope["path"]):
            sentence = "This host name is unknown. ROBOMARK_PUBLIC_URL defines the host name of this server."
            await _respond_with_refusal(scope["path"], 400, sentence)(scope, receive, send)
            return
        await self._app(scope, receive, self._add_headers(send))

    def _is_known_host(self, host: str, path: str) -> bool:
        if not path.startswith(_PROBES):
            return host in self._names
        # In DNS rebinding, the browser sends the attacker's host name. It cannot omit the Host header.
        return not host or _is_address(host) or host in self._probe_names

    def _add_headers(self, send: Send) -> Send:
        async def headed(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
                headers.setdefault("cache-control", "no-store")
                if self._secure:
                    headers.setdefault("strict-transport-security", "max-age=31536000")
            await send(message)

        return headed


def _respond_with_refusal(path: str, status: int, sentence: str) -> Response:
    return (
        respond_with_problem(status, sentence)
        if path.startswith(API_PREFIX)
        else PlainTextResponse(f"{sentence}\n", status)
    )


def _remove_quoted_cookies(name: bytes, value: bytes) -> tuple[bytes, bytes]:
    """Return a header; of a Cookie header, only the cookies without quotation marks. Robomark's own have none.

    Older versions of Python 3.11 take time proportional to the square of the length of a quoted cookie with
    backslashes, so that one header would stop the server for seconds (CVE-2024-7592).
    """
    if name.lower() != b"cookie":
        return name, value
    return name, b";".join(each for each in value.split(b";") if b'"' not in each)


def _is_address(host: str) -> bool:
    try:
        ip_address(host.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


def _parse_host(header: str) -> str:
    """Return the host name of a Host header without the port."""
    match = _NAME_AND_PORT.fullmatch(header)
    return (match[1] or header if match else header).lower()
