"""Repairs of texts by what a part sends and says, compared with what the reference's part sends and says.

The difference between the two outputs leads to one literal of the student's program, or to a text that is missing
before or after a value. A student sees only the line.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from service.grading.reruns.exchanges import list_texts_and_answers
from service.grading.reruns.repairs import Repair, replace_node
from service.mutation.source_tree import Edit, SourceTree, get_called_name, get_text
from sim.recording import Recording

_OUTPUTS = frozenset({"print", "say", "speak"})
_MAX_REPAIRS = 16


def list_output_repairs(tree: SourceTree, own: Recording, other: Recording) -> Iterator[Repair]:
    """Yield the changes of single texts that make the first different outputs of the two recordings equal."""
    repairs = (
        repair
        for own_text, other_text in _list_differences(own, other)
        for repair in (*_change_literals(tree, own_text, other_text), *_add_text(tree, own_text, other_text))
    )
    for _, repair in zip(range(_MAX_REPAIRS), repairs, strict=False):
        yield repair


def _list_differences(own: Recording, other: Recording) -> Iterator[tuple[str, str]]:
    """Yield the first two different texts of each kind of output: answers, messages, speech, print."""
    for outputs in zip(_list_outputs(own), _list_outputs(other), strict=True):
        difference = next((pair for pair in zip(*outputs, strict=False) if pair[0] != pair[1]), None)
        if difference is not None:
            yield difference


def _list_outputs(recording: Recording) -> Iterator[list[str]]:
    exchanges = list_texts_and_answers(recording)
    yield [answer.text for _, answers in exchanges for answer in answers[:1]]
    yield [text.text for text, _ in exchanges]
    yield [each.text for each in recording.spoken]
    yield [each.text for each in recording.printed]


def _change_literals(tree: SourceTree, own: str, other: str) -> Iterator[Repair]:
    """Yield each literal that is part of the output, replaced so that the output is the other one."""
    for node in tree.nodes:
        text = get_text(node)
        if text and isinstance(node, ast.Constant):
            yield from (replace_node(tree, node, repr(each)) for each in _find_replacements(text, own, other))
        elif isinstance(node, ast.JoinedStr):
            start, _ = tree.locate(node)
            for part in (get_text(each) for each in node.values):
                if part and tree.cut(node).count(part) == 1:
                    offset = start + tree.cut(node).index(part)
                    for each in _find_replacements(part, own, other):
                        if each.isprintable() and not set(each) & set("{}'\"\\"):
                            yield Repair(Edit(offset, offset + len(part), each), tree.find_line(offset))


def _find_replacements(part: str, own: str, other: str) -> Iterator[str]:
    """Yield the texts in place of ``part`` that turn ``own`` into ``other``."""
    start = own.find(part)
    while start >= 0:
        before, after = own[:start], own[start + len(part) :]
        if other.startswith(before) and other.endswith(after) and len(other) >= len(before) + len(after):
            yield other[len(before) : len(other) - len(after)]
        start = own.find(part, start + 1)


def _add_text(tree: SourceTree, own: str, other: str) -> Iterator[Repair]:
    """Yield each returned, printed or spoken value with the text that is missing before or after it."""
    missing_end = other.removeprefix(own) if other.startswith(own) else ""
    missing_start = other.removesuffix(own) if other.endswith(own) else ""
    if not missing_start and not missing_end:
        return
    for node in tree.nodes:
        value = node.value if isinstance(node, ast.Return) else None
        if isinstance(node, ast.Call) and get_called_name(node) in _OUTPUTS and len(node.args) == 1:
            value = node.args[0]
        if value is not None and not isinstance(value, ast.Starred):
            if missing_start:
                yield replace_node(tree, value, f"{missing_start!r} + str({tree.cut(value)})")
            if missing_end:
                yield replace_node(tree, value, f"str({tree.cut(value)}) + {missing_end!r}")
