"""The lines of the local engine: any bytes are a valid request or refused, and the end is noticed at once."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from processes import until
from service.notebook_engine import lines
from service.notebook_engine.lines import AnswerLine, EventLines, RequestLines, parse_line
from sim.errors import Cancelled, UsageError

pytestmark = pytest.mark.fast

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=10,
)


@given(st.binary(max_size=300))
def test_any_bytes_are_refused_in_one_sentence(data: bytes) -> None:
    with pytest.raises(UsageError) as refusal:
        parse_line(data)
    assert "\n" not in str(refusal.value)


@given(
    st.sampled_from(["magic", "check", "answer"]),
    st.dictionaries(st.sampled_from(["id", "text", "magic", "assignment", "notebook", "files", "name", "more"]), JSON),
)
def test_a_request_has_the_fields_of_its_kind_and_no_others(kind: str, fields: dict[str, Any]) -> None:
    try:
        request = parse_line(json.dumps({**fields, "do": kind}).encode())
    except UsageError:
        return
    assert request.do == kind
    assert fields.keys() | {"do"} == type(request).model_fields.keys()


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"[]",
        b"{}",
        b'{"id":1,"do":"exit"}',
        b'{"id":1,"do":["answer"],"text":null}',
        b'{"id":-1,"do":"answer","text":null}',
        b'{"id":1,"do":"answer","text":1}',
        b'{"id":1,"do":"answer"}',
        b'{"id":NaN,"do":"answer","text":null}',
        b"[" * 100_000,
        b"9" * 10_000,
    ],
)
def test_hostile_lines_are_refused(line: bytes) -> None:
    with pytest.raises(UsageError):
        parse_line(line)


@contextmanager
def request_pipe() -> Iterator[tuple[RequestLines, int]]:
    reading, writing = os.pipe()
    try:
        yield RequestLines(reading), writing
    finally:
        with suppress(OSError):
            os.close(writing)


def test_lines_arrive_whole_however_they_were_written() -> None:
    line = json.dumps({"id": 1, "do": "answer", "text": "é" * 50_000}).encode()
    with request_pipe() as (requests, writing):
        for start in range(0, len(line), 7000):
            os.write(writing, line[start : start + 7000])
        os.write(writing, b"\nsecond\nthird")
        first = parse_line(requests.take() or b"")
        assert isinstance(first, AnswerLine)
        assert first.text == "é" * 50_000
        assert requests.take() == b"second"
        requests.check()
        os.close(writing)
        assert requests.take() is None
        with pytest.raises(Cancelled):
            requests.check()


def test_a_line_without_end_ends_the_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines, "MAX_LINE_BYTES", 1000)
    with request_pipe() as (requests, writing):
        os.write(writing, b"x" * 2000)
        assert requests.take() is None


def test_the_death_of_the_parent_is_noticed_with_an_open_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines, "_PARENT_SECONDS", 0.01)
    with request_pipe() as (requests, _):
        requests.check()
        monkeypatch.setattr(os, "getppid", lambda: 1)
        assert until(lambda: requests.take() is None)


def test_a_wait_for_an_answer_has_a_bound() -> None:
    with request_pipe() as (requests, _), pytest.raises(Cancelled, match="in time"):
        requests.take(0.01)


def test_events_are_one_line_of_ascii_each_and_a_closed_reader_ends_the_engine() -> None:
    reading, writing = os.pipe()
    events = EventLines(writing)
    events.send(3, "question", text="a\nü\u2028\ud800")
    assert json.loads(os.read(reading, 1000)) == {"id": 3, "event": "question", "text": "a\nü\u2028\ud800"}
    os.close(reading)
    with pytest.raises(Cancelled):
        events.send(4, "result", result={})
    os.close(writing)
