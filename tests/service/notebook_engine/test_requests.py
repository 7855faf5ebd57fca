"""A simulator's page survives as data, and data from outside is a valid page or refused."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from responders.notebook_executor import PlannedRun
from service.grading.notebook_runs import NEW_NOTEBOOK_PAGE, NotebookPage, NotebookRuns, UnmarkedRuns
from service.grading.standalone_runs import RunLimits
from service.notebook_engine.magic_calls import _refuse_marked_run
from service.notebook_engine.requests import MagicRequest, PageData, page_to_json
from sim.errors import UsageError
from sim.floors import list_floor_names
from sim.robot import WIDENED

pytestmark = pytest.mark.fast

FLAGS = st.lists(
    st.one_of(
        st.sampled_from(list_floor_names()).map("-b {}".format),
        st.sampled_from(list(WIDENED)).map("-r {}".format),
        st.sampled_from(["None", "Wall", "Central_post", "Square_posts"]).map("-o {}".format),
        st.integers(-5000, 5000).map("-x {}".format),
        st.integers(-5000, 5000).map("-a {}".format),
        st.integers(0, 900).map("-N {} -M 3".format),
    ),
    max_size=5,
).map(" ".join)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
PAGE = page_to_json(NEW_NOTEBOOK_PAGE)
REQUEST: dict[str, Any] = {
    "cell": 1,
    "name": "sim_magic",
    "arguments": "-R",
    "body": None,
    "page": None,
    "seed": 0,
}


def page_after(*lines: str, page: NotebookPage = NEW_NOTEBOOK_PAGE) -> NotebookPage:
    """Return the page after some magics, with a program that is loaded and not run."""
    limits = RunLimits()
    unmarked_runs = UnmarkedRuns(limits.program, limits.output_bytes, 1.0, 0, {})
    runs = NotebookRuns(None, _refuse_marked_run, unmarked_runs, PlannedRun(), page)
    for line in lines:
        runs.plan_call(MagicRequest.read(REQUEST | {"arguments": line, "body": "print(1)"}).call)
    return runs.page


@given(FLAGS, FLAGS)
def test_a_page_is_the_same_after_a_round_trip(first: str, second: str) -> None:
    page = page_after(first)
    data = json.loads(json.dumps(page_to_json(page), allow_nan=False))
    again = PageData.read(data).to_page()
    assert again.state == page.state
    assert page_to_json(again) == data
    # The next magic finds the same simulator.
    assert page_after(second, page=again).state == page_after(second, page=page).state


@given(st.sampled_from(sorted(PAGE)), JSON)
def test_a_page_with_any_other_value_is_valid_or_refused(key: str, value: Any) -> None:
    try:
        page = PageData.read(PAGE | {key: value}).to_page()
    except UsageError:
        return
    assert json.loads(json.dumps(page_to_json(page), allow_nan=False))[key] == value


@pytest.mark.parametrize(
    "change",
    [
        {"background": "../../etc/passwd"},
        {"background": "Loop\x00"},
        {"robot": "Small_Robot"},  # not the chosen one
        {"obstacles": [[0, 0, 5000, 5000]]},
        {"obstacles": [[900, 500, 200]]},
        {"x": math.nan},
        {"x": math.inf},
        {"x": 1e300},
        {"x": "200"},
        {"angle_slider": True},
        {"light_noise": -1},
        {"noise_is_heard": 1},
        {"version": 2},
        {"marks": 10},
        {"program": {"cell": 1, "text": "print(1)", "preamble": "root"}},
        {"program": {"cell": 1, "text": "x" * (1 << 20) + "x", "preamble": "none"}},
        {"program": {"cell": -1, "text": "", "preamble": "none"}},
    ],
)
def test_hostile_pages_are_refused_in_one_sentence(change: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=r"request is not valid \(page") as refusal:
        MagicRequest.read(REQUEST | {"page": PAGE | change})
    assert len(str(refusal.value)) < 500


@pytest.mark.parametrize(
    "change",
    [
        {"cell": 0},
        {"cell": "1"},
        {"seed": -1},
        {"seed": 2**60},
        {"seed": 0.5},
        {"body": 3},
        {"arguments": "x" * 5000},
        {"arguments": None},
        {"user": "root"},
    ],
)
def test_hostile_requests_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="request is not valid"):
        MagicRequest.read(REQUEST | change)


def test_lone_surrogates_are_replaced() -> None:
    assert MagicRequest.read(REQUEST | {"body": "print('\ud800')"}).body == "print('?')"
