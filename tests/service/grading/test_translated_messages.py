"""Messages of criteria can be translated completely: only values such as quotes and names stay as they are.

Fixed exceptions, in English or in an author's words: errors of Python, places of faults, reasons of the source reader,
messages of an instructor's check, and notes that are stored with a submission or a recording.
"""

from __future__ import annotations

import gettext
import re
from collections.abc import Iterator
from typing import Any

import pytest

from judging import criterion, judged, lines, recorded, talk
from service.grading.judging.code import judge_source
from service.grading.judging.message_parts import join_with_commas, join_with_or, join_with_semicolons
from service.grading.judging.source_answers import SourceAnswers
from service.language import Language
from service.message_catalogue import extract_messages
from sim.recording import DatalogEntry, Message
from sim.sentences import Sentence
from submissions.magics import Flags

pytestmark = pytest.mark.fast

_PLACEHOLDER = re.compile(r"%\(\w+\)[\d.]*[a-z]")
_QUOTE = re.compile(r'"[^"]*"')
#: Names of formats and commands, which are the same in every language.
_NAMES = re.compile(r"\bJSON\b|\bimage_data both\b")
_LOST = Message(1, "robot", "PY::1", None, lost="blocked", note="lost")


class _Wordless(gettext.NullTranslations):
    """A language in which every template consists of nothing but its values."""

    def gettext(self, message: str) -> str:
        return " ".join(_PLACEHOLDER.findall(message))


WORDLESS = Language("xx", _Wordless())


def _list_templates(sentence: str) -> Iterator[str]:
    if isinstance(sentence, Sentence):
        yield sentence.template
        for value in sentence.values.values():
            yield from _list_templates(value) if isinstance(value, str) else ()


@pytest.fixture(scope="module")
def extracted_templates() -> frozenset[str]:
    return frozenset(message.id for message in extract_messages() if isinstance(message.id, str))


def _assert_translatable(sentence: str, extracted_templates: frozenset[str]) -> None:
    assert set(_list_templates(sentence)) - extracted_templates - {"%(first)s %(second)s"} == set()
    values = _NAMES.sub("", _QUOTE.sub("", WORDLESS.translate_sentence(sentence)))
    remaining_words = re.findall(r"[^\W\d_]{3,}", values)
    assert remaining_words == [], sentence


@pytest.mark.parametrize(
    ("check", "keys", "parts"),
    [
        ("prints", {"equals": ["a", "b"], "last": True}, {"printed": lines("c")}),
        ("prints", {"contains": "a", "starts_with": ["a", "b"], "at_least": 2}, {"printed": lines("ab")}),
        ("prints", {"of": "responder", "matches": "x", "exactly": 0}, {"responder_output": "x\nx"}),
        ("says", {"in_order": ["a", "b"], "only": True, "contains": "c"}, {"spoken": lines("ac", "d")}),
        ("says", {"in_order": ["a", "b"]}, {"spoken": lines("a", "c", "b")}),
        ("messages", {"among": ["a", "b"], "at_most": 0}, {"messages": talk(("PY::a", None))}),
        ("messages", {"json": True, "at_least": 1}, {"messages": talk(("PY::a", None))}),
        ("replies", {"equals": "x", "is_json": True}, {"messages": talk(("PY::a", "y"), ("PY::b", None))}),
        ("replies", {"expect": {"PY::a": "x"}}, {"messages": talk(("PY::a", "z"))}),
        ("replies", {"to_starts_with": "PY::", "at_least": 2}, {"messages": (*talk(("PY::a", "z")), _LOST)}),
        ("resends", {"every": [0.5, 2], "at_most": 3}, {"messages": talk(("PY::a", None))}),
        ("in_reach", {"at_least": 1}, {"messages": (_LOST,)}),
        ("conduct", {}, {"messages": talk(("PY::a", "JSON::{"))}),
        ("reports", {"expected": [[5, "a"]], "tolerance": 2}, {"printed": lines("7 b")}),
        ("datalog", {"series": "L", "measured": "gyro"}, {"datalog": (DatalogEntry(1.0, "L", 77.0, None),)}),
        ("datalog", {"series": "L", "covers": [1, 2]}, {"datalog": (DatalogEntry(1.0, "L", 77.0, None),)}),
        ("image_log", {"left_at_least": 2, "right": 1, "pairs": True}, {}),
        ("collects", {"classes": ["a"], "each": 2}, {}),
    ],
)
def test_messages_can_be_translated(
    check: str, keys: dict[str, Any], parts: dict[str, Any], extracted_templates: frozenset[str]
) -> None:
    result = judged(criterion(check, **keys), recorded(**parts))
    assert result.marks < result.max_marks or check in ("prints", "says")
    for message in (result.message, result.for_staff, *(each.message for each in result.evidence)):
        _assert_translatable(message, extracted_templates)


def test_messages_on_source_can_be_translated(extracted_templates: frozenset[str]) -> None:
    rule = criterion("source", uses=["for"], avoids=["say()"], in_loop=["print()"], defines=["f"], flags="-p")
    found = {
        "uses": [None],
        "avoids": [["h.py", 3]],
        "in_loop": [None],
        "defines": [None],
        "shown": [None, None],
        "doubts": [["", 2, "ev"], ["h.py", 4, "ex"]],
        "unread": None,
    }
    outcome = judge_source(rule, SourceAnswers.read(found, rule), Flags())  # type: ignore[arg-type]
    _assert_translatable(outcome.for_staff, extracted_templates)
    assert isinstance(outcome.message, Sentence)
    assert set(_list_templates(outcome.message)) - extracted_templates == {"%(first)s %(second)s"}
    assert outcome.message.count("Expected your program") == 4


@pytest.mark.parametrize(
    ("join", "text"), [(join_with_or, "a or b or c"), (join_with_commas, "a, b, c"), (join_with_semicolons, "a; b; c")]
)
def test_joined_parts(join: Any, text: str) -> None:
    assert (join(["a", "b", "c"]), join(["a"]), join([])) == (text, "a", "")
    assert isinstance(join(["a"] * 5000), Sentence)
