"""Frames from a child: for any bytes, the worker reads a valid frame or refuses."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from responders import wire

pytestmark = pytest.mark.fast

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
KINDS = [(schema, kind) for schema in (wire.ROBOT, wire.RESPONDER) for kind in schema]
UNTIL = b'{"do":"until","port":"outB","state":"still","timeout":%b}'


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        frame = wire.parse_frame(data, wire.ROBOT)
    except wire.WireError:
        return
    assert frame["do"] in wire.ROBOT


@given(st.sampled_from(KINDS), st.dictionaries(st.sampled_from(["text", "units", "line", "port", "mark", "t"]), JSON))
def test_a_frame_has_the_fields_of_its_kind_and_no_others(
    kind: tuple[wire.Schema, str], fields: dict[str, Any]
) -> None:
    schema, do = kind
    required, optional = schema[do]
    try:
        frame = wire.parse_frame(json.dumps({"do": do, **fields}).encode(), schema)
    except wire.WireError:
        return
    assert required.keys() <= frame.keys() - {"do"} <= required.keys() | optional.keys()


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"hello",
        b"[]",
        b"{}",
        b'{"do":"mark","marks":10}',
        b'{"do":"verdict","verdict":"finished"}',
        b'{"do":"acts","acts":[]}',
        UNTIL % b"-1",
        UNTIL % b"true",
        UNTIL % b"1.5",
        UNTIL % b"NaN",
        UNTIL % b"1e999",
        UNTIL % b'1,"t":99',
        UNTIL % b'1,"timeout":2',
        b'{"do":"motor_state","port":"outA"}',
        b'{"do":"polarity","port":"outB","polarity":5}',
        b'{"do":"print","text":5}',
        b'{"do":"print","text":"\xff"}',
        b'{"do":"end","error":{"type":"X","text":"y","line":1,"file":null,"verdict":"finished"}}',
        b'{"do":"end","error":{"type":"X","text":"y","line":1,"file":null,"hint":1}}',
        b'{"do":"stuck","line":1,"file":"../robot.py"}',
        b'{"do":"stuck","line":1,"file":"' + b"x" * 200 + b'.py"}',
        b"[" * 60_000,
        b'{"do":"print","text":"' + b"x" * wire.MAX_FRAME_BYTES + b'"}',
        UNTIL % (b"9" * 5000),
    ],
    ids=lambda line: repr(line[:40]),
)
def test_a_frame_that_no_honest_child_sends_is_refused(line: bytes) -> None:
    with pytest.raises(wire.WireError):
        wire.parse_frame(line, wire.ROBOT)


def test_a_lone_surrogate_becomes_a_character_that_can_be_stored() -> None:
    assert wire.parse_frame(rb'{"do":"print","text":"a\ud800b"}', wire.ROBOT)["text"] == "a?b"


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b'{"do":"wait"}',
        b'{"n":-1,"do":"wait"}',
        b'{"n":01,"do":"wait"}',
        b'{"n":1.0,"do":"wait"}',
        b'{"n":true,"do":"wait"}',
        b'{"n":1000000000000,"do":"wait"}',
        b'{"n": 1,"do":"wait"}',
        b'{"n":"1","do":"wait"}',
        b'{"do":"wait","n":1}',
    ],
)
def test_a_line_begins_with_its_number(line: bytes) -> None:
    with pytest.raises(wire.WireError, match="without its number"):
        wire.split_number(line)


def test_a_second_number_is_a_field_too_many() -> None:
    number, frame = wire.split_number(b'{"n":7,"n":8,"do":"until_said"}')
    assert number == 7
    with pytest.raises(wire.WireError):
        wire.parse_frame(frame, wire.ROBOT)
