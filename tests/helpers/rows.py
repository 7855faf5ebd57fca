"""Tables of slow test cases: the first few rows are always tested, all rows with the long tests."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet


def quick_first(names: Iterable[Any], quick: int = 1) -> list[ParameterSet]:
    """Return the rows for ``parametrize``; all but the first ``quick`` are marked long."""
    return [pytest.param(name, marks=[pytest.mark.long] * (at >= quick)) for at, name in enumerate(names)]
