"""The mutation operators for all programs, and the registry of operators.

An operator yields edits, each of which makes one fault. Operators for one part are in ``program_operators.py`` and
``responder_operators.py``.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from service.mutation.source_tree import Edit, SourceTree, get_called_name, get_number, get_text
from submissions.submission import Part

EditFinder = Callable[[SourceTree], Iterator[Edit]]
_BOTH: tuple[Part, ...] = ("program", "responder")
#: Calls that only wait.
WAITS = frozenset({"sleep", "wait", "wait_until", "wait_while", "wait_until_not_moving", "wait_until_angle_changed_by"})

_BORDERS: dict[type[ast.cmpop], str] = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
_OPPOSITES: dict[type[ast.cmpop], str] = {
    ast.Lt: ">",
    ast.LtE: ">=",
    ast.Gt: "<",
    ast.GtE: "<=",
    ast.Eq: "!=",
    ast.NotEq: "==",
}
_COMPARISON = re.compile(r"<=|>=|==|!=|<|>")
_ARITHMETIC: dict[type[ast.operator], tuple[str, str]] = {ast.Add: (r"\+", "-"), ast.Sub: ("-", "+")}
_SIMPLE = (ast.Expr, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Delete, ast.Break, ast.Continue)


@dataclass(frozen=True, slots=True)
class Operator:
    """A kind of fault: its name, the parts that it applies to, and the function that finds its edits."""

    name: str
    parts: tuple[Part, ...]
    find_edits: EditFinder


#: In the order of registration. Of equal mutants, the first operator counts.
OPERATORS: list[Operator] = []


def declare_operator(name: str, parts: tuple[Part, ...] = _BOTH) -> Callable[[EditFinder], EditFinder]:
    """Register a function as the operator with this name."""

    def register(find_edits: EditFinder) -> EditFinder:
        OPERATORS.append(Operator(name, parts, find_edits))
        return find_edits

    return register


@declare_operator("off by one")
def shift_numbers(tree: SourceTree) -> Iterator[Edit]:
    """Yield each whole number in an index or a range, and the end of each other range, changed by one."""
    for number in tree.numbers:
        if isinstance(number.value, int) and (is_index(tree, number.node) or is_range_argument(tree, number.node)):
            yield Edit(number.start, number.end, str(number.value + 1))
    for node in tree.nodes:
        if isinstance(node, ast.Call) and get_called_name(node) == "range" and node.args:
            end = node.args[min(1, len(node.args) - 1)]
            if get_number(end) is None and not isinstance(end, ast.Starred):
                yield tree.replace(end, f"({tree.cut(end)}) - 1")


@declare_operator("larger number")
def enlarge_numbers(tree: SourceTree) -> Iterator[Edit]:
    """Yield each number half as large again, and 1 for 0."""
    for number in tree.numbers:
        larger = number.value * 1.5 if isinstance(number.value, float) else _scale_whole(number.value, 3)
        yield Edit(number.start, number.end, format_number(larger or 1))


@declare_operator("smaller number")
def shrink_numbers(tree: SourceTree) -> Iterator[Edit]:
    """Yield each number except 0 with two thirds of its value."""
    for number in tree.numbers:
        if number.value:
            smaller = number.value / 1.5 if isinstance(number.value, float) else _shrink_whole(number.value)
            yield Edit(number.start, number.end, format_number(smaller))


@declare_operator("sign")
def flip_signs(tree: SourceTree) -> Iterator[Edit]:
    """Yield each number except 0 with the other sign, and each sum as a difference and the reverse."""
    for number in tree.numbers:
        if number.value and not is_index(tree, number.node):
            yield Edit(number.start, number.end, format_number(-number.value))
    for node in tree.nodes:
        if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
            pattern, other = _ARITHMETIC[type(node.op)]
            yield from tree.replace_between(node.left, node.right, re.compile(pattern), other)


@declare_operator("comparison")
def change_comparisons(tree: SourceTree) -> Iterator[Edit]:
    """Yield each comparison reversed, and with its border included or excluded."""
    for node in tree.nodes:
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for index, sign in enumerate(node.ops):
                for table in (_OPPOSITES, _BORDERS):
                    if type(sign) in table:
                        other = table[type(sign)]
                        yield from tree.replace_between(sides[index], sides[index + 1], _COMPARISON, other)


@declare_operator("condition")
def negate_conditions(tree: SourceTree) -> Iterator[Edit]:
    """Yield each condition negated, ``and`` as ``or``, and ``True`` as ``False``, each also in reverse."""
    for node in tree.nodes:
        if isinstance(node, ast.If | ast.While | ast.IfExp):
            test = node.test
            if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
                yield tree.replace(test, f"({tree.cut(test.operand)})")
            elif not (isinstance(test, ast.Constant) or _is_plain_comparison(test)):
                yield tree.replace(test, f"(not ({tree.cut(test)}))")
        elif isinstance(node, ast.BoolOp):
            word, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            yield from tree.replace_between(node.values[0], node.values[1], re.compile(rf"\b{word}\b"), other)
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            yield tree.replace(node, str(not node.value))


@declare_operator("dropped statement")
def drop_statements(tree: SourceTree) -> Iterator[Edit]:
    """Yield each simple statement replaced by ``pass``, except waits and texts that document something."""
    for node in tree.nodes:
        if isinstance(node, _SIMPLE) and not is_wait(node) and not is_documentation(node):
            yield tree.replace(node, "pass")


@declare_operator("swapped statements")
def swap_statements(tree: SourceTree) -> Iterator[Edit]:
    """Yield each two simple statements that follow each other exchanged."""
    for first, second in tree.iterate_statement_pairs():
        is_fixed = any(not isinstance(each, _SIMPLE) or is_documentation(each) for each in (first, second))
        if not is_fixed and tree.cut(first) != tree.cut(second):
            yield tree.exchange(first, second)


@declare_operator("while and if")
def exchange_while_and_if(tree: SourceTree) -> Iterator[Edit]:
    """Yield each ``while`` as ``if`` and the reverse, where the rest of the text allows it."""
    for node in tree.nodes:
        if isinstance(node, ast.While) and not node.orelse and not _has_own_jump(node.body):
            start, _ = tree.locate(node)
            yield Edit(start, start + len("while"), "if")
        elif isinstance(node, ast.If) and not node.orelse:
            start, _ = tree.locate(node)
            if tree.text.startswith("if", start):  # not elif
                yield Edit(start, start + len("if"), "while")


def is_index(tree: SourceTree, node: ast.AST) -> bool:
    """Return whether a node is an index, or the bound of a slice."""
    child = node
    for parent in tree.iterate_ancestors(node):
        if isinstance(parent, ast.Subscript):
            return parent.slice is child
        if not isinstance(parent, ast.Slice | ast.Tuple):
            return False
        child = parent
    return False


def is_range_argument(tree: SourceTree, node: ast.expr) -> bool:
    """Return whether a node is an argument of ``range``."""
    parent = tree.find_parent(node)
    return isinstance(parent, ast.Call) and get_called_name(parent) == "range" and node in parent.args


def is_wait(node: ast.AST) -> bool:
    """Return whether a statement only waits."""
    return isinstance(node, ast.Expr) and get_called_name(node.value) in WAITS


def is_documentation(node: ast.AST) -> bool:
    """Return whether a statement is only a constant: a text that documents something, or ``...``."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def list_texts(tree: SourceTree, node: ast.AST) -> Sequence[ast.expr]:
    """Return the texts of a list, a tuple or the values of a dictionary; empty for other nodes."""
    elements = node.elts if isinstance(node, ast.List | ast.Tuple) else ()
    values = node.values if isinstance(node, ast.Dict) else elements
    return [each for each in values if get_text(each) is not None]


def format_number(value: float) -> str:
    """Return a number as a student would write it, with at most six digits after the point."""
    if isinstance(value, int):
        return str(value)
    text = f"{value:.6g}"
    return text if any(each in text for each in ".e") else f"{text}.0"


def _scale_whole(value: int, halves: int) -> int:
    scaled = abs(value) * halves // 2
    return (scaled if scaled != abs(value) else abs(value) + 1) * (1 if value > 0 else -1) if value else 0


def _shrink_whole(value: int) -> int:
    return (abs(value) * 2 // 3) * (1 if value > 0 else -1)


def _is_plain_comparison(node: ast.expr) -> bool:
    """Return whether the operator ``comparison`` negates it already."""
    return isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _OPPOSITES


def _has_own_jump(body: Sequence[ast.stmt]) -> bool:
    """Return whether the body of a loop has a ``break`` or ``continue`` of this loop."""
    for node in body:
        if isinstance(node, ast.Break | ast.Continue):
            return True
        if isinstance(node, ast.For | ast.While | ast.AsyncFor):
            if _has_own_jump(node.orelse):
                return True
        elif not isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            blocks = (getattr(node, name, []) for name in ("body", "orelse", "finalbody", "handlers", "cases"))
            if any(_has_own_jump(block) for block in blocks):
                return True
    return False
