"""Compressed responses: for clients that accept gzip, with the same content, and with entity tags that still match."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest
from fastapi import Request
from fastapi.responses import Response

from service.web.compression import compress_response
from service.web.rendering import load_static_files
from web import web_in

pytestmark = pytest.mark.fast


def make_request(accept_encoding: str | None) -> Request:
    """Return a request with the header."""
    headers = [] if accept_encoding is None else [(b"accept-encoding", accept_encoding.encode())]
    return Request({"type": "http", "headers": headers})


@pytest.mark.parametrize(
    ("accept_encoding", "is_compressed"),
    [
        ("gzip", True),
        ("br, GZIP;q=0.5", True),
        ("deflate, gzip;q=1.0, *;q=0", True),
        ("*", True),
        ("gzip;q=0", False),
        ("gzip; q=0.000", False),
        ("*;q=0, br", False),
        ("identity", False),
        ("br", False),
        ("", False),
        (None, False),
    ],
)
def test_what_clients_accept_decides(accept_encoding: str | None, is_compressed: bool) -> None:
    body = b"robot " * 1000
    response = compress_response(make_request(accept_encoding), Response(body, headers={"vary": "accept-language"}))
    assert (response.headers.get("content-encoding") == "gzip") is is_compressed
    assert (gzip.decompress(response.body) if is_compressed else response.body) == body
    assert int(response.headers["content-length"]) == len(response.body)
    assert response.headers["vary"] == "accept-language, accept-encoding"


def test_tiny_bodies_stay_as_they_are() -> None:
    response = compress_response(make_request("gzip"), Response(b"short"))
    assert (response.body, response.headers.get("content-encoding")) == (b"short", None)


def test_static_files_are_compressed_and_pages_are_not(tmp_path: Path) -> None:
    with web_in(tmp_path) as web:
        browser = web.browser()
        for name in load_static_files():
            plain, compressed = (
                browser.get(f"/static/{name}", headers={"accept-encoding": each}) for each in ("identity", "gzip")
            )
            assert "content-encoding" not in plain.headers
            assert compressed.headers["content-encoding"] == "gzip"
            assert int(compressed.headers["content-length"]) < 0.6 * len(plain.content)
            assert compressed.content == plain.content
        page = web.browser(web.student()).get("/account", headers={"accept-encoding": "gzip"})
        assert len(page.content) > 1024
        assert "content-encoding" not in page.headers
