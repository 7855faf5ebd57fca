"""Saved files: whatever the file name is, there is one valid header, and no other code creates such a header."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import unquote

import anyio
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.testclient import TestClient

from builders import grading_request
from paths import ROOT
from report_builders import faulty_grade
from service.file_names import make_portable_name
from service.store.batches import intake
from service.store.people.membership import Member
from service.web.attachments import respond_with_attachment
from web import COURSE, Web, grade_all, web_in

_HEADER = re.compile(r"attachment; filename=\"([A-Za-z0-9_-][A-Za-z0-9_.-]*)\"; filename\*=UTF-8''([A-Za-z0-9._~%-]*)")


@given(st.text(max_size=40))
def test_any_name_is_one_name(name: str) -> None:
    header = respond_with_attachment(b"", name).headers["content-disposition"]
    assert _HEADER.fullmatch(header), header


@pytest.mark.parametrize("name", ["CON.txt", "nul", "Com1.tar.gz", "console.txt"])
def test_no_name_is_one_that_windows_reserves(name: str) -> None:
    match = _HEADER.fullmatch(respond_with_attachment(b"", name).headers["content-disposition"])
    assert match
    names = [match[1], unquote(match[2])]
    assert all(make_portable_name(each) == each for each in names)
    assert (names == [name, name]) is (name == "console.txt")


@pytest.mark.parametrize("character", ["x", "\u2603", "\U0001f916"])
def test_a_long_name_is_shortened_and_keeps_its_ending(character: str) -> None:
    header = respond_with_attachment(b"", f"{character * 5000}.csv").headers["content-disposition"]
    match = _HEADER.fullmatch(header)
    assert match
    assert all(name.endswith(".csv") for name in match.groups())
    assert len(header) < 2200


def _make_batch(web: Web, name: str) -> str:
    batch = intake.accept_batch(web.store, name, [grading_request("ada")], (), course=COURSE, max_attempts=3)
    grade_all(web, faulty_grade())
    return batch.id


@pytest.fixture(scope="module")
def signed_web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Web, Member, TestClient]]:
    """Return an application, and an instructor with a browser."""
    with web_in(tmp_path_factory.mktemp("home")) as web:
        grace = web.instructor()
        yield web, grace, web.browser(grace)


@pytest.mark.long
@pytest.mark.parametrize("name", ['x"; filename="evil.html', "../../x", "\u2603", "a\r\nset-cookie: b", ".hidden", ""])
def test_an_export_has_the_name_of_its_batch_and_no_more(signed_web: tuple[Web, Member, TestClient], name: str) -> None:
    web, grace, browser = signed_web
    batch_id = _make_batch(web, name)
    headers = web.token(grace, "read")
    for form in ("csv", "text", "json"):
        path = f"/courses/1/batches/{batch_id}/export?format={form}"
        for answer in (web.browser().get(f"/api/v1{path}", headers=headers), browser.get(path)):
            assert answer.status_code == 200, answer.text
            assert _HEADER.fullmatch(answer.headers["content-disposition"]), answer.headers["content-disposition"]


def test_a_student_with_a_reserved_name_gets_a_file_with_another(signed_web: tuple[Web, Member, TestClient]) -> None:
    web, _, browser = signed_web
    made = intake.accept_batch(web.store, "reserved", [grading_request("con")], (), course=COURSE, max_attempts=3)
    grade_all(web, faulty_grade())
    answer = browser.get(f"/courses/1/batches/{made.id}/export?format=text")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.namelist() == ["con~.txt"]


def test_an_instructor_exports_one_batch_at_a_time(
    signed_web: tuple[Web, Member, TestClient], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.web.context._SLOT_SECONDS", 0.1)
    web, grace, browser = signed_web
    path = f"/courses/1/batches/{_make_batch(web, 'one at a time')}/export?format=csv"
    headers = web.token(grace, "read")
    other = web.browser(web.instructor("ida"))
    with web.app.state.context.batch_exports.get_slot(grace.person_id):
        assert browser.get(path).status_code == 503
        assert web.browser().get(f"/api/v1{path}", headers=headers).status_code == 503
        assert other.get(path).status_code == 200
    assert browser.get(path).status_code == 200


def test_slow_readers_keep_no_long_download_in_memory() -> None:
    data = bytes(range(256)) * 4000
    response = respond_with_attachment(data, "data.zip", "application/zip")
    sent: list[bytes] = []
    anyio.run(_send_to, response, sent.append)
    assert b"".join(sent) == data
    assert max(map(len, sent)) <= 1 << 16
    assert response.headers["content-length"] == str(len(data))
    assert not hasattr(response, "body")
    assert response._file.closed  # type: ignore[attr-defined]


def test_the_file_of_a_download_is_removed_if_its_reader_leaves() -> None:
    def leave(body: bytes) -> None:
        raise OSError("the connection was closed")

    response = respond_with_attachment(bytes(1 << 20), "data.zip")
    with pytest.raises((OSError, ExceptionGroup, ClientDisconnect)):
        anyio.run(_send_to, response, leave)
    assert response._file.closed  # type: ignore[attr-defined]


async def _send_to(response: Response, receive_body: Callable[[bytes], None]) -> None:
    """Send a response to a function that gets the parts of its body."""

    async def receive() -> dict[str, Any]:
        await anyio.sleep_forever()
        raise AssertionError

    async def send(message: Any) -> None:
        if message.get("body"):
            receive_body(message["body"])

    await response({"type": "http", "method": "GET", "headers": []}, receive, send)


def test_only_one_function_names_files() -> None:
    files = (ROOT / "service" / "web").rglob("*.py")
    assert [path.name for path in files if "content-disposition" in path.read_text().lower()] == ["attachments.py"]
