"""A trial and its children share one processor, no two trials share one, and the old state is restored afterwards."""

from __future__ import annotations

import contextlib
import os
from concurrent.futures import ThreadPoolExecutor

import pytest

from battery import run_text
from responders.sandbox.manager import Sandboxes
from responders.sandbox.processor import one_processor

pytestmark = pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs two processors")


WHERE = "import os\nprint(sorted(os.sched_getaffinity(0)))\n"


def _where(sandboxes: Sandboxes) -> str:
    """Return the processors that a child may use."""
    with sandboxes.open_private_folder() as folder:
        output, _ = run_text(sandboxes, "robot", WHERE, folder)
    return output[-1]


def test_a_child_runs_where_its_trial_does_and_a_later_one_anywhere() -> None:
    allowed = os.sched_getaffinity(0)
    with Sandboxes() as sandboxes:
        with one_processor():
            assert _where(sandboxes) == str(sorted(os.sched_getaffinity(0)))
        assert _where(sandboxes) == str(sorted(allowed))
    assert os.sched_getaffinity(0) == allowed


def test_each_trial_has_another_and_where_none_is_free_it_runs_anywhere() -> None:
    allowed = os.sched_getaffinity(0)
    with contextlib.ExitStack() as trials:
        pools = [trials.enter_context(ThreadPoolExecutor(1)) for _ in range(len(allowed) + 1)]
        for pool in pools:
            pool.submit(trials.enter_context, one_processor()).result()
        affinities = [pool.submit(os.sched_getaffinity, 0).result() for pool in pools]
    kept_to = [each for each in affinities if len(each) == 1]
    assert len(kept_to) == len(set().union(*kept_to))
    assert allowed in affinities


def test_what_is_begun_inside_keeps_to_the_same() -> None:
    with one_processor():
        outer = os.sched_getaffinity(0)
        with one_processor():
            assert os.sched_getaffinity(0) == outer
        assert os.sched_getaffinity(0) == outer
