"""One page of the rows of a long table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class PageRows(Generic[Row]):
    """The rows of one page, its number from 1, and the number of pages."""

    rows: tuple[Row, ...]
    page: int
    pages: int


def select_page(rows: Sequence[Row], page: int, size: int) -> PageRows[Row]:
    """Return this page of ``rows`` with ``size`` rows on each; the first or last one if there is no such page."""
    pages = max(1, -(-len(rows) // size))
    page = min(max(page, 1), pages)
    return PageRows(tuple(rows[(page - 1) * size : page * size]), page, pages)
