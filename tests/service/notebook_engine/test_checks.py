"""A check judges what students can see of an assignment, and reads nothing of the rest."""

from __future__ import annotations

from dataclasses import replace

import pytest

from service.notebook_engine.checks import build_visible_assignment
from sim.errors import UsageError
from submissions.assignment.folder import list_catalogue_ids
from submissions.assignment.reader import find_assignment

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("name", list_catalogue_ids())
def test_a_check_has_only_visible_scenarios_and_criteria(name: str) -> None:
    assignment = replace(find_assignment(name), secret="a secret")
    try:
        visible = build_visible_assignment(assignment)
    except UsageError as error:
        assert "submit it instead" in str(error)  # noqa: PT017 - some assignments have nothing to check
        return
    ids = {each.id for each in visible.scenarios}
    assert {each.visibility for each in visible.scenarios} <= {"visible"}
    assert {each.visibility for each in visible.criteria} == {"visible"}
    assert all(ids.issuperset(each.scenarios) for each in visible.criteria)
    kept = {each.id for each in visible.criteria}
    assert all(each.needs is None or each.needs in kept for each in visible.criteria)
    assert visible.secret == ""
