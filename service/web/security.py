"""What holds for every answer: the headers that keep a page to itself, whose name it answers to, and how much it reads.

Plain ASGI, so that nothing inside can forget it. Who may see what is ``access.py``'s.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.web.problems import API, problem

#: The longest body of a request: an upload of a batch; what an upload may hold is the bundle reader's to say.
LARGEST_BODY = 200 * 2**20
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
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "[::1]"})
#: Asked by what watches over the service, by whatever name.
_FOR_ANY_NAME = ("/health/", "/metrics")
_TAKE_UPLOADS = ("/courses/", "/api/")


class TooMuch(HTTPException):
    """A body was longer than is read."""

    def __init__(self, most: int) -> None:
        super().__init__(413, f"This is too much: at most {most // 2**20} MB are read.")


class Guarded:
    """An application behind the headers, the names and the bound. ``public_url`` is empty on the own machine alone."""

    def __init__(self, app: ASGIApp, public_url: str) -> None:
        self._app = app
        parts = urlsplit(public_url)
        self._names = _LOOPBACK | ({parts.hostname} if parts.hostname else frozenset())
        self._secure = parts.scheme == "https"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, as ASGI has it."""
        if scope["type"] != "http":
            return
        headers = Headers(scope=scope)
        if not scope["path"].startswith(_FOR_ANY_NAME) and _host(headers.get("host", "")) not in self._names:
            sentence = "This is not a name of this server; ROBOMARK_PUBLIC_URL says which is."
            await _refusal(scope["path"], 400, sentence)(scope, receive, send)
            return
        # A body is read before anybody is asked who sends it; nothing is uploaded anywhere else.
        most = LARGEST_BODY if scope["path"].startswith(_TAKE_UPLOADS) else 2**20
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > most:
            error = TooMuch(most)
            await _refusal(scope["path"], error.status_code, error.detail)(scope, receive, self._headed(send))
            return
        await self._app(scope, _counted(receive, most), self._headed(send))

    def _headed(self, send: Send) -> Send:
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


def _counted(receive: Receive, most: int) -> Receive:
    """The body as it comes, until it is too much."""
    so_far = 0

    async def counted() -> Message:
        nonlocal so_far
        message = await receive()
        so_far += len(message.get("body", b""))
        if so_far > most:
            raise TooMuch(most)
        return message

    return counted


def _refusal(path: str, status: int, sentence: str) -> Response:
    return problem(status, sentence) if path.startswith(API) else PlainTextResponse(f"{sentence}\n", status)


def _host(header: str) -> str:
    """The name in a Host header, without its port."""
    return header.lower() if header.endswith("]") else header.lower().rpartition(":")[0] or header.lower()
