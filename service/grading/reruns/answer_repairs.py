"""Repairs of texts and answers: JSON that is missing, a wrong key, and texts that the criteria expect.

The expected texts come from the criteria of the assignment, so a student sees only the line of such a repair.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from responders import message_format
from service.grading.answer_guesses import collect_guesses
from service.grading.reruns.repairs import Repair, replace_node
from service.mutation.operators import is_documentation, is_index, list_texts
from service.mutation.source_tree import SourceTree, get_called_name, get_text
from submissions.assignment.definition import Assignment

_DUMPS = '__import__("json").dumps'
_MIN_SIMILARITY = 0.6
#: Expected texts that are tried in place of one text.
_MAX_TEXTS = 3


@dataclass(frozen=True, slots=True)
class ExpectedTexts:
    """The texts that the criteria of an assignment expect, and the keys of the expected JSON."""

    texts: tuple[str, ...]
    keys: tuple[str, ...]


def collect_expected_texts(assignment: Assignment) -> ExpectedTexts:
    """Return the texts and keys that the criteria expect."""
    guesses = collect_guesses(assignment)
    answers = (answer for _, answers in guesses.replies for answer in answers if isinstance(answer, str))
    texts = dict.fromkeys((*guesses.all_texts, *guesses.messages, *answers))
    keys = dict.fromkeys(key for place, _ in guesses.replies for key in place.split(".") if key)
    return ExpectedTexts(tuple(texts), tuple(keys))


def complete_json(tree: SourceTree, expected: ExpectedTexts) -> Iterator[Repair]:
    """Yield each dictionary with the expected keys, and each returned value as JSON with its prefix."""
    yield from _replace_keys(tree, expected)
    prefix = repr(message_format.JSON)
    for node in (each.value for each in tree.nodes if isinstance(each, ast.Return)):
        if node is None or (isinstance(node, ast.Constant) and node.value is None):
            continue
        text = tree.cut(node)
        if message_format.JSON not in text:
            yield replace_node(tree, node, f"{prefix} + ({text})")
            yield replace_node(tree, node, f"{prefix} + {_DUMPS}({text})")
            yield from (
                replace_node(tree, node, f'{prefix} + {_DUMPS}({{"{key}": {text}}})') for key in expected.keys[:1]
            )
        elif isinstance(node, ast.BinOp) and "dumps" not in text:
            yield replace_node(tree, node.right, f"{_DUMPS}({tree.cut(node.right)})")
    for node in (each for each in tree.nodes if isinstance(each, ast.Call)):
        name = get_called_name(node)
        if name in ("str", "repr") and len(node.args) == 1:
            yield replace_node(tree, node.func, _DUMPS)
        elif name == "dumps" and node.args:
            keys = [key for key in expected.keys[:1] if f'"{key}"' not in tree.cut(node.args[0])]
            yield from (replace_node(tree, node.args[0], f'{{"{key}": {tree.cut(node.args[0])}}}') for key in keys)


def _replace_keys(tree: SourceTree, expected: ExpectedTexts) -> Iterator[Repair]:
    """Yield each key of a dictionary that is not expected as each one that is, and each dictionary inside one."""
    for node in (each for each in tree.nodes if isinstance(each, ast.Dict)):
        texts = [get_text(key) for key in node.keys if key is not None]
        if not any(texts):
            continue
        missing = [key for key in expected.keys if key not in texts]
        for key_node in node.keys:
            if key_node is not None and get_text(key_node) not in (None, *expected.keys):
                yield from (replace_node(tree, key_node, repr(key)) for key in missing)
        if missing:
            yield replace_node(tree, node, f"{{{missing[0]!r}: {tree.cut(node)}}}")


def collect_keys(tree: SourceTree) -> tuple[str, ...]:
    """Return the texts that a part uses as keys, in the order of the text."""
    return tuple(dict.fromkeys(str(get_text(node)) for node in _list_keys(tree)))


def use_other_keys(tree: SourceTree, other_keys: Sequence[str]) -> Iterator[Repair]:
    """Yield each key that no other part of the submission has, as each one that only the others have."""
    missing = [key for key in other_keys if key not in collect_keys(tree)]
    for node in _list_keys(tree):
        if get_text(node) not in other_keys:
            yield from (replace_node(tree, node, repr(key)) for key in missing)


def _list_keys(tree: SourceTree) -> list[ast.expr]:
    """Return the texts that are keys of dictionaries or indices."""
    dictionaries = [key for node in tree.nodes if isinstance(node, ast.Dict) for key in node.keys if key is not None]
    indices = [node for node in tree.nodes if isinstance(node, ast.Constant) and is_index(tree, node)]
    return [each for each in (*dictionaries, *indices) if get_text(each)]


def use_expected_texts(tree: SourceTree, expected: ExpectedTexts) -> Iterator[Repair]:
    """Yield each text as the most similar expected ones: first where two texts of a list are the same."""
    documentation = {node.value for node in tree.nodes if isinstance(node, ast.Expr) and is_documentation(node)}
    literals = [each for each in tree.nodes if isinstance(each, ast.Constant) and get_text(each)]
    repeated = [text for node in tree.nodes for text in _list_repeated_texts(list_texts(tree, node))]
    for node in dict.fromkeys((*repeated, *literals)):
        text = get_text(node)
        if (text is not None and text not in expected.texts + expected.keys) or node in repeated:
            known_texts = [] if node not in repeated else [get_text(each) for each in literals]
            others = [each for each in expected.texts if each != text and each not in known_texts]
            similar_texts = difflib.get_close_matches(str(text), others, _MAX_TEXTS, _MIN_SIMILARITY)
            if node not in documentation:
                yield from (replace_node(tree, node, repr(each)) for each in similar_texts)


def _list_repeated_texts(nodes: Sequence[ast.expr]) -> list[ast.expr]:
    texts = [get_text(node) for node in nodes]
    return [node for node, text in zip(nodes, texts, strict=True) if texts.count(text) > 1]
