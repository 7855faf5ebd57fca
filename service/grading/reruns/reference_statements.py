"""Single statements of the reference in place of a student's, where the two programs have the same structure.

The programs are aligned by their statements without the names that the programs choose themselves. A statement of the
reference gets the student's names, and is left out if it needs a name that the student's program does not have.
"""

from __future__ import annotations

import ast
import builtins
import copy
import difflib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from service.grading.reruns.repairs import Repair, add_after, add_first, replace_node
from service.mutation.operators import is_documentation
from service.mutation.source_tree import SourceTree
from sim.readers.python_source import parse_module

#: The similarity, from 0 to 1, from which two statements are versions of the same one.
_MIN_SIMILARITY = 0.5
_BLOCKS = (ast.If, ast.While, ast.For, ast.With, ast.Try, ast.FunctionDef, ast.ClassDef)


@dataclass(frozen=True, slots=True)
class _Line:
    """A statement without those in its blocks. ``shape`` is its text without the names that the program binds."""

    node: ast.stmt
    depth: int
    shape: str


#: The lines of both programs that belong together; None where one program has no such line.
_Alignment = list[tuple[_Line | None, _Line | None]]


def list_reference_statements(own: SourceTree, reference: SourceTree) -> Iterator[Repair]:
    """Yield the changes that bring single statements of the student's program nearer to the reference."""
    own_names, reference_names = _collect_bound_names(own.module), _collect_bound_names(reference.module)
    alignment = _align(list(_list_lines(own.module, own_names)), list(_list_lines(reference.module, reference_names)))
    renaming = _Renaming(_map_names(alignment), frozenset(own_names), frozenset(reference_names))
    previous: _Line | None = None
    added_blocks: list[ast.stmt] = []
    for ours, other in alignment:
        if ours is None and other is not None and not any(other.node in ast.walk(each) for each in added_blocks):
            added_blocks.append(other.node)
            yield from _add(own, previous, other, renaming)
        elif ours is not None and other is not None:
            yield from _exchange(own, ours, other, renaming)
        elif ours is not None and not isinstance(ours.node, _BLOCKS):
            yield Repair(own.replace(ours.node, "pass"), ours.node.lineno, "removed")
        previous = ours or previous


def _list_lines(block: ast.AST, names: set[str], depth: int = 0) -> Iterator[_Line]:
    """Yield the statements of a block and of the blocks in it, in the order of the text."""
    for field in ("body", "handlers", "orelse", "finalbody"):
        for node in getattr(block, field, []):
            if isinstance(node, ast.ExceptHandler):
                yield from _list_lines(node, names, depth)
            elif isinstance(node, ast.stmt) and not is_documentation(node):
                yield _Line(node, depth, _render_head(_Renamer(dict.fromkeys(names, "_")).visit(_copy_head(node))))
                yield from _list_lines(node, names, depth + 1)


def _copy_head(node: ast.stmt) -> ast.stmt:
    """Return a copy of a statement without its blocks."""
    if not isinstance(node, _BLOCKS):
        return copy.deepcopy(node)
    blocks = {"body": [ast.Pass()], "orelse": [], "finalbody": [], "handlers": []}
    head = type(node)(**{name: blocks.get(name, copy.deepcopy(value)) for name, value in ast.iter_fields(node)})
    return ast.fix_missing_locations(head)


def _render_head(node: ast.stmt) -> str:
    if isinstance(node, ast.Try):
        return "try"
    return ast.unparse(ast.fix_missing_locations(node))


def _align(own: Sequence[_Line], reference: Sequence[_Line]) -> _Alignment:
    own_keys, reference_keys = ([(each.depth, each.shape) for each in lines] for lines in (own, reference))
    alignment: _Alignment = []
    for tag, start, end, first, last in difflib.SequenceMatcher(
        a=own_keys, b=reference_keys, autojunk=False
    ).get_opcodes():
        if tag == "equal":
            alignment += zip(own[start:end], reference[first:last], strict=True)
        else:
            alignment += _align_versions(own[start:end], reference[first:last])
    return alignment


def _align_versions(own: Sequence[_Line], reference: Sequence[_Line]) -> _Alignment:
    """Return lines without an equal one, each beside the first similar line of the other program."""
    alignment: _Alignment = []
    rest = list(own)
    for other in reference:
        number = next((number for number, each in enumerate(rest) if _are_similar(each, other)), None)
        if number is None:
            alignment.append((None, other))
            continue
        alignment += [(each, None) for each in rest[:number]]
        alignment.append((rest[number], other))
        rest = rest[number + 1 :]
    return [*alignment, *((each, None) for each in rest)]


def _are_similar(own: _Line, other: _Line) -> bool:
    if type(own.node) is not type(other.node) or own.depth != other.depth:
        return False
    return difflib.SequenceMatcher(None, own.shape, other.shape).ratio() >= _MIN_SIMILARITY


class _Renamer(ast.NodeTransformer):
    """Replaces names, also those of functions, arguments and global declarations."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = names

    def visit_Name(self, node: ast.Name) -> ast.Name:
        return ast.Name(self._names.get(node.id, node.id), node.ctx)

    def visit_arg(self, node: ast.arg) -> ast.arg:
        return ast.arg(self._names.get(node.arg, node.arg), None)

    def visit_Global(self, node: ast.Global) -> ast.Global:
        return ast.Global([self._names.get(name, name) for name in node.names])

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.name = self._names.get(node.name, node.name)
        return self.generic_visit(node)


@dataclass(frozen=True, slots=True)
class _Renaming:
    """The student's names for those of the reference, and the names that each program binds."""

    names: Mapping[str, str]
    own_names: frozenset[str]
    reference_names: frozenset[str]

    def render(self, node: ast.stmt) -> str | None:
        """Return a statement of the reference with the student's names; None if one of them is missing."""
        stored_names = _collect_bound_names(node)
        for name in {each.id for each in ast.walk(node) if isinstance(each, ast.Name)} - stored_names:
            is_given = name not in self.reference_names or hasattr(builtins, name)
            if not is_given and self.names.get(name, name) not in self.own_names:
                return None
        return ast.unparse(ast.fix_missing_locations(_Renamer(self.names).visit(copy.deepcopy(node))))


def _map_names(alignment: _Alignment) -> dict[str, str]:
    """Return the student's name for each name of the reference that has the same place in most lines."""
    votes: dict[str, Counter[str]] = {}
    for ours, other in alignment:
        if ours is None or other is None or ours.shape != other.shape:
            continue
        pairs = zip(_list_own_names(ours.node), _list_own_names(other.node), strict=False)
        for own_name, name in pairs:
            votes.setdefault(name, Counter())[own_name] += 1
    # A name that both programs have is the same, unless another one has its place more often.
    return {name: max(counts, key=lambda each: (counts[each], each == name)) for name, counts in votes.items()}


def _list_own_names(node: ast.stmt) -> list[str]:
    head = _copy_head(node)
    names = [
        each.id if isinstance(each, ast.Name) else each.arg
        for each in ast.walk(head)
        if isinstance(each, ast.Name | ast.arg)
    ]
    return [node.name, *names] if isinstance(node, ast.FunctionDef) else names


def _collect_bound_names(tree: ast.AST) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.alias):
            names.add((node.asname or node.name).partition(".")[0])
    return names


def _exchange(tree: SourceTree, ours: _Line, other: _Line, renaming: _Renaming) -> Iterator[Repair]:
    """Yield the smallest part of the reference's statement that differs, in place of the student's."""
    heads = [_copy_head(ours.node), _copy_head(other.node)]
    if type(heads[0]) is not type(heads[1]) or isinstance(heads[0], ast.FunctionDef | ast.ClassDef | ast.Try):
        return
    new = renaming.render(heads[1])
    if new is None or new == ast.unparse(heads[0]):
        return
    own_part, part = _narrow(heads[0], parse_module(new).body[0])
    if isinstance(own_part, ast.expr):
        yield replace_node(tree, own_part, ast.unparse(part))
    elif not isinstance(ours.node, _BLOCKS):
        yield Repair(tree.replace(ours.node, new), ours.node.lineno)


def _narrow(own: ast.AST, other: ast.AST) -> tuple[ast.AST, ast.AST]:
    """Return the innermost pair of nodes in the same place that contains all differences."""
    while type(own) is type(other):
        pairs = list(zip(ast.iter_child_nodes(own), ast.iter_child_nodes(other), strict=False))
        different = [pair for pair in pairs if ast.dump(pair[0]) != ast.dump(pair[1])]
        is_complete = len(list(ast.iter_child_nodes(own))) == len(list(ast.iter_child_nodes(other)))
        is_inner = len(different) == 1 and is_complete and isinstance(different[0][0], ast.expr | ast.comprehension)
        if not is_inner or not _has_same_values(own, other) or isinstance(own, ast.JoinedStr):
            break
        own, other = different[0]
    return own, other


def _has_same_values(own: ast.AST, other: ast.AST) -> bool:
    """Return whether the fields that are no nodes, such as operators' names, are equal."""
    values = [
        [value for _, value in ast.iter_fields(node) if not isinstance(value, ast.AST | list)] for node in (own, other)
    ]
    return values[0] == values[1]


def _add(tree: SourceTree, previous: _Line | None, other: _Line, renaming: _Renaming) -> Iterator[Repair]:
    """Yield the reference's statement after the student's previous line, in the block of the same depth."""
    new = renaming.render(other.node)
    if new is None:
        return
    if previous is None:
        yield add_first(tree, tree.module.body, new)
        return
    block = previous.node
    if previous.depth + 1 == other.depth and isinstance(block, _BLOCKS):
        yield add_first(tree, block.body, new)
        return
    for ancestor in (block, *tree.iterate_ancestors(block)):
        if isinstance(ancestor, ast.stmt) and _measure_depth(tree, ancestor) == other.depth:
            yield add_after(tree, ancestor, new)
            return


def _measure_depth(tree: SourceTree, node: ast.stmt) -> int:
    return sum(isinstance(each, ast.stmt) for each in tree.iterate_ancestors(node))
