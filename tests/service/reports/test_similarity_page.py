"""Similar submissions, for staff as a page, a table and JSON, without data of a run; not for students."""

from __future__ import annotations

import dataclasses
import json
import typing

import numpy as np
import pytest
from numpy.typing import NDArray

import report_builders
from page_reader import ATTRIBUTES, TAGS, Reader
from service.grading.grade import Grade
from service.reports import view
from service.reports.similarity import (
    build_similarity_rows,
    describe_similarity,
    render_similarity_page,
    similarity_to_json,
)
from service.reports.view import View, build_similarity_view
from service.similarity.behaviour import SharedBehaviour, TrialName
from service.similarity.pairs import Similarity, SimilarPair
from service.similarity.similar_sources import SimilarSources, Stretch

BOTH = ("<b>ada", "bob\u202e")
ALIKE = SimilarSources(BOTH, ("robot.py", "<i>.py"), (0.75, 0.5), (80, 120), (Stretch((2, 3), (1, 4), 60),))
TRIAL = SharedBehaviour(TrialName("<u>line", 0, True), "path", 2, 12)
FOUND = Similarity("shape-recognition", 12, (SimilarPair(BOTH, (ALIKE,), (TRIAL,)),), ("cyd",))


def text_of(assignment: str, student: str, file: str) -> str:
    assert (assignment, student) == ("shape-recognition", BOTH[file == "<i>.py"])
    return f"nothing\n    {report_builders.HOSTILE}\nlast of {file} {'x' * 1_000_000}\nend\n"


@pytest.fixture(scope="module")
def page() -> str:
    return render_similarity_page(build_similarity_view([FOUND]), text_of, "Similar submissions in <class>", 100)


def test_the_page_shows_both_sources_side_by_side_with_their_lines(page: str) -> None:
    text = " ".join(Reader(page).text.split())
    assert "staff only" in text
    assert "robot.py, 75% of 80 tokens" in text
    assert "<i>.py, 50% of 120 tokens" in text
    assert "last of robot.py" in text
    assert "<u>line 1with noisepath2 of 12" in text


def test_nothing_that_a_student_wrote_becomes_markup_or_is_endless(page: str) -> None:
    reader = Reader(page)
    assert reader.tags <= TAGS
    assert {name for _, name, _ in reader.attributes} <= ATTRIBUTES | {"colspan", "open"}
    assert "script" not in reader.tags
    assert "\u202e" not in page
    assert len(page) < 60_000


def test_pairs_beyond_the_most_are_counted() -> None:
    many = dataclasses.replace(FOUND, pairs=FOUND.pairs * 5)
    view = build_similarity_view([many])
    assert "3 more pairs are not shown." in render_similarity_page(view, text_of, "Similar", 2)
    assert "1 more pair is not shown." in render_similarity_page(view, text_of, "Similar", 4)


def test_json_has_everything() -> None:
    (document,) = json.loads(json.dumps(similarity_to_json(build_similarity_view([FOUND]))))
    (pair,) = document["pairs"]
    assert document["too_short"] == ["cyd"]
    assert (pair["students"], pair["share"]) == (list(BOTH), 0.75)
    assert pair["sources"][0]["stretches"] == [{"lines": [2, 3], "other_lines": [1, 4], "tokens": 60}]
    assert pair["trials"][0]["trial"] == {"scenario": "<u>line", "index": 0, "noisy": True}


def test_the_table_says_how_much_and_where() -> None:
    assert describe_similarity(FOUND).startswith(
        "shape-recognition: 1 similar pair among 12 students; 1 student has too little code"
    )
    assert build_similarity_rows(FOUND) == [(*BOTH, "75%", "robot.py and <i>.py", "1 trial")]


def test_no_grade_and_no_view_of_one_can_have_it_in_it() -> None:
    """Formats, reports and pages are made from a grade. No grade contains similarities, so no student can see them."""
    assert not any(kind.__module__.startswith("service.similarity") for kind in _within(Grade) | _within(View))
    makers = [each for each in vars(view).values() if "SimilarityView" in str(getattr(each, "__annotations__", {}))]
    assert makers == [build_similarity_view]


def _within(kind: object) -> set[type]:
    """Return all dataclasses that a value of this type can contain."""
    types: set[type] = set()
    waiting = [kind]
    while waiting:
        each = waiting.pop()
        waiting += typing.get_args(each)
        if isinstance(each, type) and dataclasses.is_dataclass(each) and each not in types:
            types.add(each)
            waiting += typing.get_type_hints(each, localns={"NDArray": NDArray, "np": np}).values()
    return types
