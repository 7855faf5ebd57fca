"""Judges give their findings as values. Hints read those of visible trials, and the store keeps none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from judging import criterion, judged, lines, recorded, talk
from service.grading.findings import (
    ExtraText,
    Finding,
    HurriedSpeech,
    MissingEntry,
    OtherAnswer,
    OtherWord,
    ReportedFault,
    StrayItems,
)
from service.grading.grade import Evidence
from service.grading.hint_clues import find_finding, remove_hidden_evidence
from service.store.codec import decode, encode
from sim.recording import Fault, Verdict

pytestmark = pytest.mark.fast

_FAULT = Fault(2.0, Verdict.PROGRAM_ERROR, "program", "KeyError: 'label'", 3)


@pytest.mark.parametrize(
    ("check", "keys", "parts", "findings"),
    [
        ("finishes", {}, {"faults": (_FAULT,), "verdict": Verdict.PROGRAM_ERROR}, (ReportedFault(_FAULT),)),
        ("finishes", {}, {}, ()),
        (
            "reports",
            {"source": "print", "expected": [["black", 12]]},
            {"printed": lines("black", "13")},
            (MissingEntry("12", "black", ("black", "13")),),
        ),
        (
            "sequence",
            {"words": ["1", ["2", "two"], "3"]},
            {"spoken": lines("1", "4")},
            (OtherWord(("1",), "4", ("2", "two")),),
        ),
        ("sequence", {"words": ["1", "2"]}, {"spoken": lines("1")}, (OtherWord(("1",), "", ("2",)),)),
        ("sequence", {"words": ["1"]}, {"spoken": lines("1", "go")}, (ExtraText("go"),)),
        (
            "sequence",
            {"words": ["one", "two"], "waits": True},
            {"spoken": tuple(replace(line, t=0.1 * line.t) for line in lines("one", "two"))},
            (HurriedSpeech(),),
        ),
        (
            "says",
            {"in_order": ["red", "green"], "only": True},
            {"spoken": lines("red", "blue", "green")},
            (ExtraText("blue"),),
        ),
        (
            "says",
            {"equals": "red", "strays": 0},
            {"spoken": lines("red", "a", "b", "c")},
            (StrayItems(3, is_only_problem=True),),
        ),
        (
            "replies",
            {"expect": {"PY::a": "1"}, "path": "label"},
            {"messages": talk(("PY::a", 'JSON::{"label": "[1]"}'))},
            (OtherAnswer("[1]"),),
        ),
    ],
)
def test_a_failure_has_its_values(
    check: str, keys: dict[str, Any], parts: dict[str, Any], findings: tuple[Finding, ...]
) -> None:
    result = judged(criterion(check, **keys), recorded(**parts))
    assert result.findings == ({0: findings} if findings else {})
    for finding in findings:
        assert find_finding(result, type(finding)) == finding


def test_findings_are_by_trial_and_those_of_hidden_trials_are_left_out() -> None:
    rule = criterion("says", in_order=["red"], only=True)
    result = judged(rule, *(recorded(spoken=lines("red", extra)) for extra in ("left", "right")))
    assert result.findings == {0: (ExtraText("left"),), 1: (ExtraText("right"),)}
    actual = remove_hidden_evidence(result, {1})
    assert actual.findings == {1: (ExtraText("right"),)}
    assert find_finding(actual, ExtraText) == ExtraText("right")


def test_stored_evidence_has_the_same_form_as_before() -> None:
    result = judged(criterion("finishes"), recorded(faults=(_FAULT,), verdict=Verdict.PROGRAM_ERROR))
    stored = encode(result.evidence)
    assert decode(tuple[Evidence, ...], stored) == result.evidence
    assert isinstance(stored, list)
    assert [set(each) for each in stored if isinstance(each, dict)] == [
        {"trial", "passed", "message", "t", "pose", "measures"}
    ]
    assert replace(result, findings={}) == result
