"""What holds of the tests themselves."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from naming import is_named
from paths import TESTS
from service.store.ids import ALPHABET

#: Of so few letters a text is now and then in an id, a secret or a hash by chance.
_BY_CHANCE = re.compile(rf"[{ALPHABET}]{{1,4}}")
#: Without ids and secrets: the same grade is read and written there each time.
_WITHOUT_IDS = {"grading", "reports"}
_WITH_IDS = sorted(file for file in (TESTS / "service").rglob("*.py") if file.parent.name not in _WITHOUT_IDS)


@pytest.mark.parametrize("file", _WITH_IDS, ids=lambda file: file.stem)
def test_no_random_id_can_break_a_test(file: Path) -> None:
    """That a short text is not in an answer is asked by ``naming.is_named``, which ids do not answer by chance."""
    found = [
        f"{file.name}:{node.lineno}: {node.left.value!r} not in {ast.unparse(node.comparators[0])}"
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Compare)
        and isinstance(node.ops[0], ast.NotIn)
        and isinstance(node.left, ast.Constant)
        and isinstance(node.left.value, str)
        and _BY_CHANCE.fullmatch(node.left.value)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("by ada", True),
        ("{'who': 'ada'}", True),
        ("ada_1.zip", True),
        ("xadax", False),
        ("4ada5", False),
        ("Ada", False),
    ],
)
def test_who_is_named_is_found_and_an_id_is_not(text: str, named: bool) -> None:
    assert is_named("ada", text) is named
