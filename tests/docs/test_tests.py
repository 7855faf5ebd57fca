"""Rules for the tests themselves."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from naming import is_named
from paths import TESTS
from service.store.ids import ALPHABET

#: A text of so few letters occasionally occurs in an id, a secret or a hash by chance.
_BY_CHANCE = re.compile(rf"[{ALPHABET}]{{1,4}}")
#: Folders of tests without ids and secrets: they use the same grade each time.
_WITHOUT_IDS = {"grading", "reports"}
_WITH_IDS = sorted(file for file in (TESTS / "service").rglob("*.py") if file.parent.name not in _WITHOUT_IDS)


@pytest.mark.parametrize("file", _WITH_IDS, ids=lambda file: file.stem)
def test_no_random_id_can_break_a_test(file: Path) -> None:
    """Tests that a short text is absent must use ``naming.is_named``, which random ids cannot match by chance."""
    violations = [
        f"{file.name}:{node.lineno}: {node.left.value!r} not in {ast.unparse(node.comparators[0])}"
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Compare)
        and isinstance(node.ops[0], ast.NotIn)
        and isinstance(node.left, ast.Constant)
        and isinstance(node.left.value, str)
        and _BY_CHANCE.fullmatch(node.left.value)
    ]
    assert violations == []


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
