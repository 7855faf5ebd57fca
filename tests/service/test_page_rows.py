"""Pages of tables: every row is on one page, and a number without a page gives the nearest one."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.page_rows import PageRows, select_page

pytestmark = pytest.mark.fast


@given(st.lists(st.integers(), max_size=30), st.integers(1, 7))
def test_the_pages_together_have_every_row_in_order(rows: list[int], size: int) -> None:
    pages = select_page(rows, 1, size).pages
    shown = [select_page(rows, page, size) for page in range(1, pages + 1)]
    assert [row for page in shown for row in page.rows] == rows
    assert [page.page for page in shown] == list(range(1, pages + 1))
    assert all(page.rows for page in shown) == bool(rows)


@pytest.mark.parametrize(("page", "expected"), [(-3, 1), (0, 1), (3, 3), (4, 3), (10**30, 3)])
def test_a_page_that_does_not_exist_gives_the_nearest(page: int, expected: int) -> None:
    assert select_page(["a", "b", "c", "d", "e"], page, 2).page == expected


def test_no_rows_have_one_empty_page() -> None:
    assert select_page([], 5, 10) == PageRows((), 1, 1)
