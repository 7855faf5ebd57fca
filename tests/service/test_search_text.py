"""Searches ignore case and accents."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.search_text import fold_text

pytestmark = pytest.mark.fast


@pytest.mark.parametrize(
    ("typed", "name"),
    [
        ("jurgen schmo", "Jürgen Schmökel"),
        ("JURGEN", "Ju\u0308rgen"),
        ("otsuka", "Ōtsuka"),
        ("strasse", "Straße"),
        ("soren lodz", "Søren Łódź"),
        ("Jürgen", "Jürgen"),
        ("o'neill", "O'Neill"),
        ("大塚", "大塚"),
    ],
)
def test_what_is_typed_finds_the_name(typed: str, name: str) -> None:
    assert fold_text(typed) in fold_text(name)


def test_other_letters_are_not_found() -> None:
    assert fold_text("jorgen") not in fold_text("Jürgen")


@given(st.text())
def test_a_folded_text_stays_as_it_is(text: str) -> None:
    folded = fold_text(text)
    assert fold_text(folded) == folded
