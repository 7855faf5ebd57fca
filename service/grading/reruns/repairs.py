"""Repairs: single changes of a program that undo a common mistake, such as a missing wait or a motor that never stops.

They are tried one after the other. Nothing shows that a program has the mistake until its trial passes with the repair.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

from service.grading.reruns.exchanges import ChangeKind
from service.mutation.operators import is_documentation, is_index, is_range_argument, is_wait
from service.mutation.source_tree import Edit, SourceTree, get_called_name, get_number, get_text

_SIMPLE = (ast.Expr, ast.Assign, ast.AugAssign, ast.AnnAssign)
_LOOPS = (ast.While, ast.For)
_SUMS = (ast.Add, ast.Sub)
_SIDE = re.compile(r"left|right", re.IGNORECASE)
_OTHER_SIDES = {"left": "right", "right": "left", "Left": "Right", "Right": "Left", "LEFT": "RIGHT", "RIGHT": "LEFT"}
#: Seconds of the waits that are tried. One may be too short for an answer, the other too long for a moving robot.
_WAITS = ("1", "0.2")
_MESSAGES = ("PY::", "IMG_DATA")


@dataclass(frozen=True, slots=True)
class Repair:
    """An edit and what it does. ``line`` is that of the change; for an addition, the one that it follows."""

    edit: Edit
    line: int
    kind: ChangeKind = "changed"


RepairFinder = Callable[[SourceTree], Iterator[Repair]]


def add_after(tree: SourceTree, statement: ast.stmt, new: str, kind: ChangeKind = "added") -> Repair:
    """Return the repair that adds a statement after another one, in the same block."""
    _, end = tree.locate(statement)
    indent = " " * statement.col_offset
    return Repair(Edit(end, end, f"\n{indent}{new}"), tree.find_line(end), kind)


def add_first(tree: SourceTree, block: Sequence[ast.stmt], new: str) -> Repair:
    """Return the repair that adds a statement at the beginning of a block."""
    start, _ = tree.locate(block[0])
    indent = " " * block[0].col_offset
    return Repair(Edit(start, start, f"{new}\n{indent}"), max(tree.find_line(start) - 1, 1), "added")


def replace_node(tree: SourceTree, node: ast.expr, new: str) -> Repair:
    """Return the repair that replaces an expression."""
    edit = tree.replace(node, new)
    return Repair(edit, tree.find_line(edit.start))


def stop_motors(tree: SourceTree) -> Iterator[Repair]:
    """Yield ``x.off()`` after each loop, and after the last wait, that follows a start of motors that never stop."""
    for block in tree.iterate_blocks():
        for number, statement in enumerate(block):
            started = _find_started_motors(tree, statement)
            rest = block[number + 1 :]
            if not started or any(f"{started}.off(" in tree.cut(each) for each in rest):
                continue
            waits = [each for each in rest if is_wait(each)]
            places = [each for each in rest if isinstance(each, _LOOPS)] + waits[-1:]
            yield from (add_after(tree, each, f"{started}.off()") for each in places)


def reread_values(tree: SourceTree) -> Iterator[Repair]:
    """Yield a copy of the assignment of each name in a loop's condition that the loop does not change."""
    for loop in (each for each in tree.nodes if isinstance(each, ast.While)):
        stored_names = _collect_names(loop.body, ast.Store)
        for name in dict.fromkeys(_list_names(loop.test, ast.Load)):
            if name in stored_names:
                continue
            for assignment in _list_assignments(tree, name):
                if assignment.lineno < loop.lineno and get_number(assignment.value) is None:
                    yield add_after(tree, loop.body[-1], tree.cut(assignment))
                elif assignment.lineno < loop.lineno:
                    yield from (add_after(tree, loop.body[-1], f"{name} {sign}= 1") for sign in "+-")


def set_flags(tree: SourceTree) -> Iterator[Repair]:
    """Yield the change of a flag in each branch that tests it and does not change it."""
    constants = [each for each in tree.nodes if isinstance(each, ast.Assign) and _is_flag(each.value)]
    flags = {each.id for node in constants for each in node.targets if isinstance(each, ast.Name)}
    for branch in (each for each in tree.nodes if isinstance(each, ast.If)):
        for name in dict.fromkeys(_list_names(branch.test, ast.Load)):
            if name in flags and name not in _collect_names(branch.body, ast.Store):
                yield add_after(tree, branch.body[-1], f"{name} = not {name}")


def declare_globals(tree: SourceTree) -> Iterator[Repair]:
    """Yield the declaration of each global name that a function assigns as a local one."""
    outer_names = _collect_names(
        [each for each in tree.module.body if not isinstance(each, ast.FunctionDef)], ast.Store
    )
    for function in (each for each in tree.nodes if isinstance(each, ast.FunctionDef)):
        declared = {name for node in ast.walk(function) if isinstance(node, ast.Global) for name in node.names}
        names = _collect_names(function.body, ast.Store) & outer_names - declared
        yield from (add_first(tree, function.body, f"global {name}") for name in sorted(names))


def return_values(tree: SourceTree) -> Iterator[Repair]:
    """Yield a return of each value that a function prints, and of the name that its last statement assigns."""
    for function in (each for each in tree.nodes if isinstance(each, ast.FunctionDef)):
        for node in ast.walk(function):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) and _is_output(node) and node.value.args:
                edit = tree.replace(node, f"return {tree.cut(node.value.args[0])}")
                yield Repair(edit, tree.find_line(edit.start))
        last = function.body[-1]
        if isinstance(last, ast.Assign) and isinstance(last.targets[0], ast.Name):
            yield add_after(tree, last, f"return {last.targets[0].id}")


def exchange_sides(tree: SourceTree) -> Iterator[Repair]:
    """Yield each name, attribute and text with left or right for the other side, if the text has that one too."""
    for node in tree.nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            other = _exchange_side(node.id)
            if other != node.id and re.search(rf"\b{other}\b|\bcolor(Left|Right)\b", tree.text):
                yield replace_node(tree, node, other)
        elif isinstance(node, ast.Attribute) and _exchange_side(node.attr) != node.attr:
            _, end = tree.locate(node)
            start = end - len(node.attr)
            yield Repair(Edit(start, end, _exchange_side(node.attr)), tree.find_line(start))
        elif isinstance(node, ast.Constant) and get_text(node) in _OTHER_SIDES:
            yield replace_node(tree, node, repr(_OTHER_SIDES[str(get_text(node))]))


def exchange_operands(tree: SourceTree) -> Iterator[Repair]:
    """Yield each difference and quotient with its operands exchanged."""
    for node in tree.nodes:
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub | ast.Div):
            edit = tree.exchange(node.left, node.right)
            yield Repair(edit, tree.find_line(edit.start))


def shift_indices(tree: SourceTree) -> Iterator[Repair]:
    """Yield each index and bound that is one smaller or counts from the other end, and without an added number."""
    for number in tree.numbers:
        if isinstance(number.value, int) and (is_index(tree, number.node) or is_range_argument(tree, number.node)):
            for value in dict.fromkeys((number.value - 1, -number.value - 1)):
                yield Repair(Edit(number.start, number.end, str(value)), number.line)
    for node in tree.nodes:
        if isinstance(node, ast.Slice) and node.step is None and (node.lower is None) != (node.upper is None):
            bound = tree.cut(node).replace(":", "").strip()
            yield replace_node(tree, node, f"{bound}:" if node.lower is None else f":{bound}")
        elif isinstance(node, ast.BinOp) and type(node.op) in _SUMS and get_number(node.right) is not None:
            yield replace_node(tree, node, f"({tree.cut(node.left)})")


def move_into_and_out_of_loops(tree: SourceTree) -> Iterator[Repair]:
    """Yield the last statement of each loop behind the loop, and the one behind it as its last."""
    for block in tree.iterate_blocks():
        for loop, following in zip(block, [*block[1:], None], strict=True):
            if not isinstance(loop, _LOOPS) or loop.orelse:
                continue
            last = loop.body[-1]
            if len(loop.body) > 1 and isinstance(last, _SIMPLE):
                yield _indent(tree, last, " " * loop.col_offset)
            if isinstance(following, _SIMPLE) and not is_documentation(following):
                yield _indent(tree, following, " " * last.col_offset)


def add_waits_after_messages(tree: SourceTree) -> Iterator[Repair]:
    """Yield a wait after each print of a program that sends messages, if no wait follows it."""
    if any(message in tree.text for message in _MESSAGES):
        statements = [each for each in _list_statements_without_wait(tree) if _is_output(each)]
        yield from (add_after(tree, each, _build_wait(_WAITS[0]), "wait") for each in statements)


def add_waits(tree: SourceTree) -> Iterator[Repair]:
    """Yield a wait after each statement that no wait follows, first at the ends of loops."""
    ends = {loop.body[-1] for loop in tree.nodes if isinstance(loop, _LOOPS)}
    statements = sorted(_list_statements_without_wait(tree), key=lambda each: (each not in ends, each.lineno))
    for seconds in _WAITS:
        yield from (add_after(tree, each, _build_wait(seconds), "wait") for each in statements)


def _build_wait(seconds: str) -> str:
    return f'__import__("time").sleep({seconds})'


def _list_statements_without_wait(tree: SourceTree) -> list[ast.stmt]:
    return [
        statement
        for block in tree.iterate_blocks()
        for statement, following in zip(block, [*block[1:], None], strict=True)
        if isinstance(statement, (*_SIMPLE, *_LOOPS))
        and not is_documentation(statement)
        and not is_wait(statement)
        and (following is None or not is_wait(following))
    ]


def remove_statements(tree: SourceTree) -> Iterator[Repair]:
    """Yield each simple statement replaced by ``pass``."""
    for node in tree.nodes:
        if isinstance(node, _SIMPLE) and not is_documentation(node):
            edit = tree.replace(node, "pass")
            yield Repair(edit, tree.find_line(edit.start), "removed")


def _find_started_motors(tree: SourceTree, statement: ast.stmt) -> str:
    """Return the motors that a statement starts without an end, as in the text; empty if there are none."""
    call = statement.value if isinstance(statement, ast.Expr) else None
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Attribute) or call.func.attr != "on":
        return ""
    return tree.cut(call.func.value)


def _list_names(node: ast.AST, context: type[ast.expr_context]) -> Iterator[str]:
    for each in ast.walk(node):
        if isinstance(each, ast.Name) and isinstance(each.ctx, context):
            yield each.id


def _collect_names(nodes: Sequence[ast.AST], context: type[ast.expr_context]) -> set[str]:
    return set(chain.from_iterable(_list_names(node, context) for node in nodes))


def _list_assignments(tree: SourceTree, name: str) -> Iterator[ast.Assign]:
    for node in tree.nodes:
        if isinstance(node, ast.Assign) and name in _collect_names(node.targets, ast.Store):
            yield node


def _is_flag(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, bool)


def _is_output(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and get_called_name(node.value) == "print"


def _exchange_side(name: str) -> str:
    return _SIDE.sub(lambda match: _OTHER_SIDES.get(match[0], match[0]), name)


def _indent(tree: SourceTree, statement: ast.stmt, indent: str) -> Repair:
    """Return the repair that moves a statement to another block by its indentation."""
    start, _ = tree.locate(statement)
    return Repair(Edit(tree.find_line_start(statement.lineno), start, indent), statement.lineno)
