"""Messages of judging are sentences that can be translated: no text for people is put together by other means."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from service.grading import judging
from service.grading.judging.robustness import CONDITION_WORDS
from submissions.assignment.scenario import CONDITIONS

_FOLDER = Path(judging.__path__[0])
_MODULES = sorted(path.stem for path in _FOLDER.glob("*.py"))
_WORD = re.compile(r"[A-Za-z]{2}")
#: Parts of errors about an assignment, which are in English.
_ASSIGNMENT_ERRORS = ("check returned", "The assignment's own check fails")


@pytest.mark.parametrize("module", _MODULES)
def test_messages_are_sentences(module: str) -> None:
    tree = ast.parse((_FOLDER / f"{module}.py").read_text())
    # Errors are in English.
    nodes = list(_walk_outside_raise(tree))
    formatted_texts = [ast.unparse(node) for node in nodes if isinstance(node, ast.JoinedStr) and _has_words(node)]
    plain_texts = [
        ast.unparse(node.args[0])
        for node in nodes
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in ("fail_with", "pass_with", "Measure")
        and isinstance(node.args[0], ast.Constant)
    ]
    assert formatted_texts + plain_texts == []


def test_the_names_and_units_of_conditions_are_marked_for_translation() -> None:
    assert {each.words for each in CONDITIONS.values()} | {each.unit for each in CONDITIONS.values()} == CONDITION_WORDS


def _walk_outside_raise(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all nodes except ``raise`` statements and what is in them."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.Raise):
            yield node
            yield from _walk_outside_raise(node)


def _has_words(text: ast.JoinedStr) -> bool:
    words = " ".join(str(part.value) for part in text.values if isinstance(part, ast.Constant))
    return bool(_WORD.search(words)) and not any(error in words for error in _ASSIGNMENT_ERRORS)
