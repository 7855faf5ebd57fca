"""Walks through a syntax tree and adds its names and constructs to the contents of the file.

It executes nothing and applies no rules; ``reader.py`` applies them. ``name_recorder.py`` reads single nodes.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from .. import cell_source
from .contents import Context
from .lookups import may_unpickle
from .name_recorder import NameRecorder
from .node_properties import (
    collect_bound_names,
    collect_certain_bindings,
    collect_defined_names,
    collect_outer_names,
    collect_parameters,
    evaluate_condition,
    is_block_end,
    is_empty_loop,
    list_blocks,
    read_constant,
    read_constant_text,
)
from .units import CodeUnit
from .vocabulary import (
    CONSTRUCTS,
    DOUBTFUL,
    GETTERS,
    IMPORTERS,
    MAGICS,
    RUNNERS,
    TAKES_NAME,
    TAKES_NAMES,
)

_MAX_TEXT_DEPTH = 8


class SyntaxWalker(NameRecorder):
    """Adds what it finds to the contents."""

    def __init__(self, doubt_about: Callable[[str], str]) -> None:
        """Start with no contents. ``doubt_about`` returns the doubt about importing a module as text, or ""."""
        super().__init__(doubt_about)
        self._owner = ""
        self._depth = 0

    def read_tree(self, tree: ast.Module, file: str, unit: CodeUnit) -> None:
        """Add the contents of ``tree``. ``file`` is its name in messages."""
        self._begin_unit(file, unit)
        self._record_names(tree)
        self._walk_statements(tree.body, Context())

    def read_magic(self, magic: cell_source.CellMagic, file: str, unit: CodeUnit) -> None:
        """Add the contents of a cell magic."""
        self._begin_unit(file, unit)
        self._visit_magic(magic.name, magic.line, magic.body, magic.number, Context())

    def _record_names(self, tree: ast.Module) -> None:
        self._naming.record_names(tree)
        self.made |= collect_defined_names(tree)

    # statements

    def _walk_statements(self, body: Sequence[ast.stmt], context: Context) -> None:
        outer_statement = self._statement
        for statement in body:
            self._statement = self._find_start(statement)
            self._visit(statement, context)
            if context.live:
                self._naming.bind(collect_certain_bindings(statement))
            context = context._replace(live=context.live and not is_block_end(statement))
        self._statement = outer_statement

    def _find_start(self, statement: ast.stmt) -> tuple[int, int]:
        """Return the line and column of a statement; inside a text that is run, those of the statement that runs it."""
        return self._statement if self._depth else (statement.lineno, statement.col_offset)

    def _walk_block(self, body: Sequence[ast.stmt], context: Context, binding_nodes: Sequence[ast.AST] = ()) -> None:
        """Walk through a block that may not run. ``binding_nodes`` are the nodes whose names it binds first."""
        with self._naming.block():
            if context.live:
                self._naming.bind(collect_bound_names(binding_nodes))
            self._walk_statements(body, context)

    def _visit(self, node: ast.AST, context: Context) -> None:
        construct = CONSTRUCTS.get(type(node))
        if construct is not None:
            # For a loop, its body has to run; for any other statement, the statement itself.
            body = node.body[0] if isinstance(node, ast.For | ast.AsyncFor | ast.While) else None
            self._add_mention("construct", construct, node, context, self._find_start(body) if body else None)
        if isinstance(node, ast.If | ast.For | ast.AsyncFor | ast.While) and node.orelse:
            self._add_mention("construct", "else", node, context, self._find_start(node.orelse[0]))
        _VISITORS.get(type(node), SyntaxWalker._visit_parts)(self, node, context)

    def _visit_parts(self, node: ast.AST, context: Context) -> None:
        for _, value in ast.iter_fields(node):
            parts = value if isinstance(value, list) else [value]
            if parts and isinstance(parts[0], ast.stmt):
                self._walk_block(parts, context)
            else:
                self._visit_each((part for part in parts if isinstance(part, ast.AST)), context)

    def _visit_each(self, nodes: Iterable[ast.AST | None], context: Context) -> None:
        for node in nodes:
            if node is not None:
                self._visit(node, context)

    def _visit_if(self, node: ast.If, context: Context) -> None:
        self._visit(node.test, context)
        for block, live in list_blocks(node):
            self._walk_block(block, context._replace(live=context.live and live))

    def _visit_while(self, node: ast.While, context: Context) -> None:
        loop_context = Context(context.live and evaluate_condition(node.test) is not False, True)
        self._visit(node.test, loop_context)
        self._walk_block(node.body, loop_context)
        self._walk_block(node.orelse, context)

    def _visit_for(self, node: ast.For | ast.AsyncFor, context: Context) -> None:
        self._visit_each((node.iter, node.target), context)
        self._walk_block(node.body, Context(context.live and not is_empty_loop(node.iter), True), [node.target])
        self._walk_block(node.orelse, context)

    def _visit_with(self, node: ast.With | ast.AsyncWith, context: Context) -> None:
        self._visit_each(node.items, context)
        self._walk_block(node.body, context, node.items)

    def _visit_handler(self, node: ast.ExceptHandler, context: Context) -> None:
        self._visit_each([node.type], context)
        self._walk_block(node.body, context, [ast.Name(node.name, ast.Store())] if node.name else [])

    def _visit_case(self, node: ast.match_case, context: Context) -> None:
        self._visit_each((node.pattern, node.guard), context)
        self._walk_block(node.body, context, [node.pattern])

    def _visit_class_pattern(self, node: ast.MatchClass, context: Context) -> None:
        for attribute in node.kwd_attrs:
            self._add_text_name(attribute, node, context)
        self._visit_parts(node, context)

    def _visit_function(self, node: ast.FunctionDef | ast.AsyncFunctionDef, context: Context) -> None:
        self._add_mention("function", node.name, node, context)
        if node.name in DOUBTFUL and node.name.startswith("__"):
            self._add_mention("doubt", node.name, node, context)
        # Defaults and annotations are evaluated where the function is defined.
        self._visit_each([*node.decorator_list, node.args, node.returns], context)
        function_unit = CodeUnit(node.name, self._owner, self._unit, context.live, bool(node.decorator_list))
        self.units.append(function_unit)
        self._unit.units.append(function_unit)
        outer_unit = self._unit, self._owner
        self._unit, self._owner = function_unit, ""
        bound_names = collect_parameters(node) | collect_bound_names(node.body) - collect_outer_names(node)
        with self._naming.scope("function", bound_names):
            self._walk_statements(node.body, Context())
        self._unit, self._owner = outer_unit

    def _visit_lambda(self, node: ast.Lambda, context: Context) -> None:
        self._visit(node.args, context)
        with self._naming.scope("function", collect_parameters(node)):
            self._visit(node.body, context)

    def _visit_class(self, node: ast.ClassDef, context: Context) -> None:
        self._visit_each([*node.decorator_list, *node.bases, *node.keywords], context)
        owner, self._owner = self._owner, node.name
        with self._naming.scope("class"):
            self._walk_statements(node.body, context)
        self._owner = owner

    # expressions

    def _visit_comprehension(self, node: Any, context: Context) -> None:
        first_generator, *other_generators = node.generators
        self._visit(first_generator.iter, context)
        loop_context = Context(context.live and not is_empty_loop(first_generator.iter), True)
        with self._naming.scope("comprehension", collect_bound_names([each.target for each in node.generators])):
            self._visit_each([first_generator.target, *first_generator.ifs, *other_generators], loop_context)
            self._visit_each([getattr(node, name, None) for name in ("elt", "key", "value")], loop_context)

    def _visit_conditional(self, node: ast.IfExp, context: Context) -> None:
        condition = evaluate_condition(node.test)
        self._visit(node.test, context)
        self._visit(node.body, context._replace(live=context.live and condition is not False))
        self._visit(node.orelse, context._replace(live=context.live and condition is not True))

    def _visit_walrus(self, node: ast.NamedExpr, context: Context) -> None:
        self._visit_each((node.value, node.target), context)
        if context.live:
            self._naming.bind({node.target.id}, is_sure=False)

    def _visit_bool_op(self, node: ast.BoolOp, context: Context) -> None:
        deciding_value = isinstance(node.op, ast.Or)
        for value in node.values:
            self._visit(value, context)
            context = context._replace(live=context.live and evaluate_condition(value) is not deciding_value)

    def _visit_chain(self, node: ast.Name | ast.Attribute, context: Context, kind: str = "handed_on") -> None:
        """Add a name or a dotted name. ``kind`` says how it is used."""
        names = self._naming.resolve_names(node)
        is_own = self._naming.is_own(node.id) if isinstance(node, ast.Name) else False
        for name in names:
            self._add_mention("name", name, node, context)
            if kind == "call":
                self._add_mention(kind, name, node, context)
            elif isinstance(node.ctx, ast.Load) and is_own is not True:
                self._add_mention("unsure" if is_own is None else kind, name, node, context)
        if isinstance(node, ast.Attribute):
            if self._naming.is_imported(node):
                self._add_mention("through", names[-1], node, context)
            self._visit_base(node.value, context)
        if isinstance(node.ctx, ast.Load) and kind != "call" and (is_own is not True or self._naming.is_imported(node)):
            self._doubt_name_taker(names, node, context)
        if is_own is not True and node not in self._understood:
            self._doubt_chain(names, node, context)

    def _visit_base(self, node: ast.expr, context: Context) -> None:
        if isinstance(node, ast.Name | ast.Attribute):
            self._visit_chain(node, context, "base")
        else:
            self._visit(node, context)

    def _visit_subscript(self, node: ast.Subscript, context: Context) -> None:
        self._add_table_lookup(node.value, node.slice, node, context)
        self._visit_parts(node, context)

    def _visit_call(self, node: ast.Call, context: Context) -> None:
        function = node.func
        calls = {name.rpartition(".")[2] for name in self._naming.resolve_names(function)}
        texts = [read_constant_text(argument) for argument in node.args]
        if isinstance(function, ast.Attribute) and function.attr in GETTERS and node.args:
            self._add_table_lookup(function.value, node.args[0], node, context)
        for call in sorted(calls & TAKES_NAME.keys()):
            argument_index = TAKES_NAME[call]
            is_known = len(texts) > argument_index and not any(
                isinstance(each, ast.Starred) for each in node.args[:argument_index]
            )
            self._add_name_or_doubt(call, texts[argument_index] if is_known else None, node, context)
        for call in sorted(calls & TAKES_NAMES):
            for argument, text in zip(node.args, texts, strict=True):
                if text is not None or not isinstance(argument, ast.Constant):
                    self._add_name_or_doubt(call, text, node, context)
        module_name = next((text for text in texts if text), None)
        if calls & IMPORTERS and module_name is not None:
            if texts[0] is not None:
                self._understood.add(function)
            self._add_mention("import", module_name.replace(":", "."), node, context)
        source = read_constant(node.args[0]) if calls & RUNNERS and node.args else None
        if source is not None and self._walk_text(_remove_indent(source, calls), node.lineno, context):
            self._understood.add(function)
        if may_unpickle(node, calls):
            self._add_mention("doubt", "allow_pickle", node, context)
        self._add_looked_up_names(node, calls, context)
        for call in sorted(calls & MAGICS):
            self._visit_magic_call(call, texts, node, context)
        if isinstance(function, ast.Name | ast.Attribute):
            self._visit_chain(function, context, "call")
        else:
            self._visit(function, context)
        self._visit_each([*node.args, *node.keywords], context)

    # texts that are run

    def _walk_text(self, source: str | bytes, line: int, context: Context) -> bool:
        """Walk through a text that is run as Python, at its place. Return whether it could be parsed."""
        if self._depth >= _MAX_TEXT_DEPTH:
            return False
        try:
            tree = ast.parse(source)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            return False
        ast.increment_lineno(tree, line - 1)
        self._record_names(tree)
        self._depth += 1
        self._walk_block(tree.body, context)
        self._depth -= 1
        return True

    def _visit_magic_call(self, call: str, texts: list[str | None], node: ast.Call, context: Context) -> None:
        known_texts = [text for text in texts if text is not None]
        if not texts or len(known_texts) < len(texts) or node.keywords:
            self._add_mention("any_name", call, node, context)
            return
        self._understood.add(node.func)
        if call == "magic":
            known_texts = list(known_texts[0].partition(" ")[::2])
        name, line, body = (*known_texts, "", "")[:3]
        self._visit_magic(name.lstrip("%"), line, body if call == "run_cell_magic" else None, node.lineno, context)

    def _visit_magic(self, name: str, line: str, body: str | None, number: int, context: Context) -> None:
        """Walk through the code that a magic runs: expressions in its line; for some magics the line or the cell."""
        position_node = ast.Pass(lineno=number)
        expressions = list(cell_source.list_expressions(line))
        is_readable = [self._walk_text(expression.lstrip(" \t"), number, context) for expression in expressions]
        if name in cell_source.LINE_WRAPPERS and body is None:
            if expressions:
                self._add_mention("any_name", f"a value in the line of %{name}", position_node, context)
            is_readable.append(self._walk_text(cell_source.extract_wrapped_code(line).lstrip(" \t"), number, context))
        elif name in cell_source.WRAPPERS and body is not None:
            inner_magic = cell_source.parse_cell_magic(body)
            if inner_magic is not None:
                self._visit_magic(
                    inner_magic.name, inner_magic.line, inner_magic.body, number + inner_magic.number, context
                )
            else:
                is_readable.append(self._walk_text(cell_source.convert_to_python(body), number + 1, context))
        elif name == "run" and body is None:
            self._add_mention(
                "import", line.split()[0].removesuffix(".py") if line.split() else "", position_node, context
            )
        elif name in ("writefile", "file") and body is not None:
            self.written.append(("".join(line.split()[-1:]).strip("'\""), body))
        if not all(is_readable):
            self._add_mention("any_name", f"the text of a magic called {name}", position_node, context)


def _remove_indent(source: str | bytes, calls: set[str]) -> str | bytes:
    """Remove the leading blanks and tabs of a text as ``eval`` does; ``exec`` and ``compile`` refuse them."""
    if "eval" not in calls:
        return source
    return source.lstrip(" \t") if isinstance(source, str) else source.lstrip(b" \t")


_VISITORS: Mapping[type[ast.AST], Callable[[SyntaxWalker, Any, Context], None]] = {
    ast.If: SyntaxWalker._visit_if,
    ast.While: SyntaxWalker._visit_while,
    ast.For: SyntaxWalker._visit_for,
    ast.AsyncFor: SyntaxWalker._visit_for,
    ast.With: SyntaxWalker._visit_with,
    ast.AsyncWith: SyntaxWalker._visit_with,
    ast.ExceptHandler: SyntaxWalker._visit_handler,
    ast.match_case: SyntaxWalker._visit_case,
    ast.MatchClass: SyntaxWalker._visit_class_pattern,
    ast.FunctionDef: SyntaxWalker._visit_function,
    ast.AsyncFunctionDef: SyntaxWalker._visit_function,
    ast.Lambda: SyntaxWalker._visit_lambda,
    ast.ClassDef: SyntaxWalker._visit_class,
    ast.ListComp: SyntaxWalker._visit_comprehension,
    ast.SetComp: SyntaxWalker._visit_comprehension,
    ast.DictComp: SyntaxWalker._visit_comprehension,
    ast.GeneratorExp: SyntaxWalker._visit_comprehension,
    ast.IfExp: SyntaxWalker._visit_conditional,
    ast.NamedExpr: SyntaxWalker._visit_walrus,
    ast.BoolOp: SyntaxWalker._visit_bool_op,
    ast.Name: SyntaxWalker._visit_chain,
    ast.Attribute: SyntaxWalker._visit_chain,
    ast.Subscript: SyntaxWalker._visit_subscript,
    ast.Call: SyntaxWalker._visit_call,
    ast.Import: SyntaxWalker._visit_import,
    ast.ImportFrom: SyntaxWalker._visit_import_from,
}
