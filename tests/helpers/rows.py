"""Rows of a table of cases that each take seconds: the first few are tested every time, all with the long tests."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet


def quick_first(names: Iterable[Any], quick: int = 1) -> list[ParameterSet]:
    """The rows that ``parametrize`` takes; all but the first ``quick`` are long."""
    return [pytest.param(name, marks=[pytest.mark.long] * (at >= quick)) for at, name in enumerate(names)]
