"""Saved files: whatever the file name is, there is one valid header, and no other code creates such a header."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.testclient import TestClient

from builders import grading_request
from paths import ROOT
from report_builders import faulty_grade
from service.store.batches import intake
from service.store.people.membership import Member
from service.web.attachments import respond_with_attachment
from web import COURSE, Web, grade_all, web_in

_HEADER = re.compile(r"attachment; filename=\"([A-Za-z0-9_-][A-Za-z0-9_.-]*)\"; filename\*=UTF-8''([A-Za-z0-9._~%-]*)")


@given(st.text(max_size=40))
def test_any_name_is_one_name(name: str) -> None:
    header = respond_with_attachment(b"", name).headers["content-disposition"]
    assert _HEADER.fullmatch(header), header


@pytest.mark.parametrize("character", ["x", "\u2603", "\U0001f916"])
def test_a_long_name_is_shortened_and_keeps_its_ending(character: str) -> None:
    header = respond_with_attachment(b"", f"{character * 5000}.csv").headers["content-disposition"]
    match = _HEADER.fullmatch(header)
    assert match
    assert all(name.endswith(".csv") for name in match.groups())
    assert len(header) < 2200


@pytest.fixture(scope="module")
def signed_web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Web, Member, TestClient]]:
    """Return an application, and an instructor with a browser."""
    with web_in(tmp_path_factory.mktemp("home")) as web:
        grace = web.instructor()
        yield web, grace, web.browser(grace)


@pytest.mark.parametrize("name", ['x"; filename="evil.html', "../../x", "\u2603", "a\r\nset-cookie: b", ".hidden", ""])
def test_an_export_has_the_name_of_its_batch_and_no_more(signed_web: tuple[Web, Member, TestClient], name: str) -> None:
    web, grace, browser = signed_web
    made = intake.accept_batch(web.store, name, [grading_request("ada")], (), course=COURSE, max_attempts=3)
    grade_all(web, faulty_grade())
    headers = web.token(grace, "read")
    for form in ("csv", "text", "json"):
        path = f"/courses/1/batches/{made.id}/export?format={form}"
        for answer in (web.browser().get(f"/api/v1{path}", headers=headers), browser.get(path)):
            assert answer.status_code == 200, answer.text
            assert _HEADER.fullmatch(answer.headers["content-disposition"]), answer.headers["content-disposition"]


def test_only_one_function_names_files() -> None:
    files = (ROOT / "service" / "web").rglob("*.py")
    assert [path.name for path in files if "content-disposition" in path.read_text().lower()] == ["attachments.py"]
