"""Walks through a syntax tree and records its contents: the place, reachability, and position in a loop.

It executes nothing and applies no rules. ``reader.py`` does.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from .. import cell_source
from .lookups import list_name_arguments, may_unpickle
from .node_properties import (
    collect_bound_names,
    collect_certain_bindings,
    collect_defined_names,
    collect_outer_names,
    collect_parameters,
    evaluate_condition,
    is_block_end,
    is_doubtful_import,
    is_empty_loop,
    list_blocks,
    read_constant,
    read_constant_text,
)
from .scopes import SymbolTable
from .units import CodeUnit, Mention, SourcePlace
from .vocabulary import (
    CONSTRUCTS,
    DOUBTFUL,
    DOUBTFUL_ALONE,
    DOUBTFUL_METHODS,
    GETTERS,
    IMPORTERS,
    MAGICS,
    NAME_TAKERS,
    RUNNERS,
    TABLES,
    TAKES_NAME,
    TAKES_NAMES,
)

_MAX_TEXT_DEPTH = 8
#: Maximum number of places kept per mention.
_MOST_PLACES = 200


class _Context(NamedTuple):
    live: bool = True
    looped: bool = False


class SyntaxWalker:
    """The contents of one file, or of the cells of one notebook."""

    def __init__(self, doubt_about: Callable[[str], str]) -> None:
        """Start with no contents. ``doubt_about`` returns the doubt about importing a module as text, or ""."""
        self.units: list[CodeUnit] = []
        #: Files that a notebook writes: names and texts.
        self.written: list[tuple[str, str]] = []
        self._doubt_about = doubt_about
        self._naming = SymbolTable()
        self._file = ""
        self._unit = CodeUnit("")
        self._owner = ""
        self._understood: set[ast.AST] = set()  # doubtful nodes with visible arguments
        self._depth = 0
        self._statement = (0, 0)  # start of the current statement
        #: Names that the source defines itself.
        self.made: set[str] = set()

    def read_tree(self, tree: ast.Module, file: str, unit: CodeUnit) -> None:
        """Add the contents of ``tree``. ``file`` is its name in messages."""
        self._begin_unit(file, unit)
        self._naming.record_names(tree)
        self.made |= collect_defined_names(tree)
        self._walk_statements(tree.body, _Context())

    def read_magic(self, magic: cell_source.CellMagic, file: str, unit: CodeUnit) -> None:
        """Add the contents of a cell magic."""
        self._begin_unit(file, unit)
        self._visit_magic(magic.name, magic.line, magic.body, magic.number, _Context())

    def _begin_unit(self, file: str, unit: CodeUnit) -> None:
        self._file, self._unit = file, unit
        self.units.append(unit)

    def _add_mention(
        self, kind: str, name: str, node: ast.AST, here: _Context, statement: tuple[int, int] | None = None
    ) -> None:
        """Add a mention. ``statement`` is the start of the statement that has to run for it, or the current one."""
        if name:
            place = SourcePlace(self._file, getattr(node, "lineno", 0), statement or self._statement)
            places = self._unit.mentions.setdefault(Mention(kind, name, here.live, here.looped), [])
            if len(places) < _MOST_PLACES:
                places.append(place)

    def _add_text_name(self, text: str, node: ast.AST, here: _Context) -> None:
        self._add_mention("handed_on", text, node, here)
        self._add_mention("name", text, node, here)
        for part in sorted(DOUBTFUL.intersection(text.split("."))):
            self._add_mention("any_name" if part in TABLES | RUNNERS | MAGICS else "doubt", part, node, here)

    # statements

    def _walk_statements(self, body: Sequence[ast.stmt], here: _Context) -> None:
        before = self._statement
        for statement in body:
            self._statement = self._find_start(statement)
            self._visit(statement, here)
            if here.live:
                self._naming.bind(collect_certain_bindings(statement))
            here = here._replace(live=here.live and not is_block_end(statement))
        self._statement = before

    def _find_start(self, statement: ast.stmt) -> tuple[int, int]:
        """Return the line and column of a statement; inside a text that is run, those of the statement that runs it."""
        return self._statement if self._depth else (statement.lineno, statement.col_offset)

    def _walk_block(self, body: Sequence[ast.stmt], here: _Context, bound: Sequence[ast.AST] = ()) -> None:
        """Walk through a block that may not run. ``bound`` are the nodes whose names it binds first."""
        with self._naming.block():
            if here.live:
                self._naming.bind(collect_bound_names(bound))
            self._walk_statements(body, here)

    def _visit(self, node: ast.AST, here: _Context) -> None:
        construct = CONSTRUCTS.get(type(node))
        if construct is not None:
            # For a loop, its body has to run; for any other statement, the statement itself.
            body = node.body[0] if isinstance(node, ast.For | ast.AsyncFor | ast.While) else None
            self._add_mention("construct", construct, node, here, self._find_start(body) if body else None)
        if isinstance(node, ast.If | ast.For | ast.AsyncFor | ast.While) and node.orelse:
            self._add_mention("construct", "else", node, here, self._find_start(node.orelse[0]))
        _VISITORS.get(type(node), SyntaxWalker._visit_parts)(self, node, here)

    def _visit_parts(self, node: ast.AST, here: _Context) -> None:
        for _, value in ast.iter_fields(node):
            parts = value if isinstance(value, list) else [value]
            if parts and isinstance(parts[0], ast.stmt):
                self._walk_block(parts, here)
            else:
                self._visit_each((part for part in parts if isinstance(part, ast.AST)), here)

    def _visit_each(self, nodes: Iterable[ast.AST | None], here: _Context) -> None:
        for node in nodes:
            if node is not None:
                self._visit(node, here)

    def _visit_if(self, node: ast.If, here: _Context) -> None:
        self._visit(node.test, here)
        for block, live in list_blocks(node):
            self._walk_block(block, here._replace(live=here.live and live))

    def _visit_while(self, node: ast.While, here: _Context) -> None:
        inside = _Context(here.live and evaluate_condition(node.test) is not False, True)
        self._visit(node.test, inside)
        self._walk_block(node.body, inside)
        self._walk_block(node.orelse, here)

    def _visit_for(self, node: ast.For | ast.AsyncFor, here: _Context) -> None:
        self._visit_each((node.iter, node.target), here)
        self._walk_block(node.body, _Context(here.live and not is_empty_loop(node.iter), True), [node.target])
        self._walk_block(node.orelse, here)

    def _visit_with(self, node: ast.With | ast.AsyncWith, here: _Context) -> None:
        self._visit_each(node.items, here)
        self._walk_block(node.body, here, node.items)

    def _visit_handler(self, node: ast.ExceptHandler, here: _Context) -> None:
        self._visit_each([node.type], here)
        self._walk_block(node.body, here, [ast.Name(node.name, ast.Store())] if node.name else [])

    def _visit_case(self, node: ast.match_case, here: _Context) -> None:
        self._visit_each((node.pattern, node.guard), here)
        self._walk_block(node.body, here, [node.pattern])

    def _visit_class_pattern(self, node: ast.MatchClass, here: _Context) -> None:
        for attribute in node.kwd_attrs:
            self._add_text_name(attribute, node, here)
        self._visit_parts(node, here)

    def _visit_function(self, node: ast.FunctionDef | ast.AsyncFunctionDef, here: _Context) -> None:
        self._add_mention("function", node.name, node, here)
        if node.name in DOUBTFUL and node.name.startswith("__"):
            self._add_mention("doubt", node.name, node, here)
        # Defaults and annotations are evaluated where the function is defined.
        self._visit_each([*node.decorator_list, node.args, node.returns], here)
        within = CodeUnit(node.name, self._owner, self._unit, here.live, bool(node.decorator_list))
        self.units.append(within)
        self._unit.units.append(within)
        around = self._unit, self._owner
        self._unit, self._owner = within, ""
        bound = collect_parameters(node) | collect_bound_names(node.body) - collect_outer_names(node)
        with self._naming.scope("function", bound):
            self._walk_statements(node.body, _Context())
        self._unit, self._owner = around

    def _visit_lambda(self, node: ast.Lambda, here: _Context) -> None:
        self._visit(node.args, here)
        with self._naming.scope("function", collect_parameters(node)):
            self._visit(node.body, here)

    def _visit_class(self, node: ast.ClassDef, here: _Context) -> None:
        self._visit_each([*node.decorator_list, *node.bases, *node.keywords], here)
        owner, self._owner = self._owner, node.name
        with self._naming.scope("class"):
            self._walk_statements(node.body, here)
        self._owner = owner

    # expressions

    def _visit_comprehension(self, node: Any, here: _Context) -> None:
        first, *others = node.generators
        self._visit(first.iter, here)
        inside = _Context(here.live and not is_empty_loop(first.iter), True)
        with self._naming.scope("comprehension", collect_bound_names([each.target for each in node.generators])):
            self._visit_each([first.target, *first.ifs, *others], inside)
            self._visit_each([getattr(node, name, None) for name in ("elt", "key", "value")], inside)

    def _visit_conditional(self, node: ast.IfExp, here: _Context) -> None:
        known = evaluate_condition(node.test)
        self._visit(node.test, here)
        self._visit(node.body, here._replace(live=here.live and known is not False))
        self._visit(node.orelse, here._replace(live=here.live and known is not True))

    def _visit_walrus(self, node: ast.NamedExpr, here: _Context) -> None:
        self._visit_each((node.value, node.target), here)
        if here.live:
            self._naming.bind({node.target.id}, sure=False)

    def _visit_bool_op(self, node: ast.BoolOp, here: _Context) -> None:
        decides = isinstance(node.op, ast.Or)
        for value in node.values:
            self._visit(value, here)
            here = here._replace(live=here.live and evaluate_condition(value) is not decides)

    def _visit_chain(self, node: ast.Name | ast.Attribute, here: _Context, kind: str = "handed_on") -> None:
        """Add a name or a dotted name. ``kind`` says how it is used."""
        names = self._naming.resolve_names(node)
        own = self._naming.is_own(node.id) if isinstance(node, ast.Name) else False
        for name in names:
            self._add_mention("name", name, node, here)
            if kind == "call":
                self._add_mention(kind, name, node, here)
            elif isinstance(node.ctx, ast.Load) and own is not True:
                self._add_mention("unsure" if own is None else kind, name, node, here)
        if isinstance(node, ast.Attribute):
            if self._naming.is_imported(node):
                self._add_mention("through", names[-1], node, here)
            self._visit_base(node.value, here)
        if isinstance(node.ctx, ast.Load) and kind != "call" and (own is not True or self._naming.is_imported(node)):
            self._doubt_name_taker(names, node, here)
        if own is not True and node not in self._understood:
            self._doubt_chain(names, node, here)

    def _doubt_name_taker(self, names: list[str], node: ast.AST, here: _Context) -> None:
        """Add doubt for a function such as ``getattr`` passed on (``map(getattr, ...)``): it may look up any name."""
        for last in {name.rpartition(".")[2] for name in names} & NAME_TAKERS:
            self._add_mention("any_name", last, node, here)

    def _visit_base(self, node: ast.expr, here: _Context) -> None:
        if isinstance(node, ast.Name | ast.Attribute):
            self._visit_chain(node, here, "base")
        else:
            self._visit(node, here)

    def _doubt_chain(self, names: list[str], node: ast.AST, here: _Context) -> None:
        alone = DOUBTFUL_ALONE if isinstance(node, ast.Name) else DOUBTFUL_METHODS
        lasts = [name.rpartition(".")[2] for name in names]
        doubtful = next((last for last in lasts if last in DOUBTFUL), lasts[0] if lasts[0] in alone else "")
        if doubtful:
            self._add_mention("any_name" if doubtful in TABLES | RUNNERS | MAGICS else "doubt", doubtful, node, here)
        elif "sys.modules" in names:
            self._add_mention("doubt", "sys.modules", node, here)
        elif self._naming.may_be_imported(node):
            self._add_mention("doubt", next(filter(is_doubtful_import, names), ""), node, here)

    def _visit_subscript(self, node: ast.Subscript, here: _Context) -> None:
        self._add_table_lookup(node.value, node.slice, node, here)
        self._visit_parts(node, here)

    def _add_table_lookup(self, table: ast.expr, key: ast.expr, node: ast.AST, here: _Context) -> None:
        """Add the name looked up in a table (``globals()["say"]``), if the text shows both."""
        named = table.func if isinstance(table, ast.Call) else table
        names = self._naming.resolve_names(named)
        text = read_constant_text(key)
        if text is None:
            return
        if "sys.modules" in names:
            self._add_mention("import", text, node, here)
        elif any(name.rpartition(".")[2] in TABLES for name in names):
            self._add_text_name(text, node, here)
        else:
            return
        self._understood.add(named)

    def _visit_call(self, node: ast.Call, here: _Context) -> None:
        function = node.func
        calls = {name.rpartition(".")[2] for name in self._naming.resolve_names(function)}
        texts = [read_constant_text(argument) for argument in node.args]
        if isinstance(function, ast.Attribute) and function.attr in GETTERS and node.args:
            self._add_table_lookup(function.value, node.args[0], node, here)
        for call in sorted(calls & TAKES_NAME.keys()):
            place = TAKES_NAME[call]
            is_known = len(texts) > place and not any(isinstance(each, ast.Starred) for each in node.args[:place])
            self._add_name_or_doubt(call, texts[place] if is_known else None, node, here)
        for call in sorted(calls & TAKES_NAMES):
            for argument, text in zip(node.args, texts, strict=True):
                if text is not None or not isinstance(argument, ast.Constant):
                    self._add_name_or_doubt(call, text, node, here)
        named = next((text for text in texts if text), None)
        if calls & IMPORTERS and named is not None:
            if texts[0] is not None:
                self._understood.add(function)
            self._add_mention("import", named.replace(":", "."), node, here)
        source = read_constant(node.args[0]) if calls & RUNNERS and node.args else None
        if source is not None and self._walk_text(_remove_indent(source, calls), node.lineno, here):
            self._understood.add(function)
        if may_unpickle(node, calls):
            self._add_mention("doubt", "allow_pickle", node, here)
        self._add_looked_up_names(node, calls, here)
        for call in sorted(calls & MAGICS):
            self._visit_magic_call(call, texts, node, here)
        if isinstance(function, ast.Name | ast.Attribute):
            self._visit_chain(function, here, "call")
        else:
            self._visit(function, here)
        self._visit_each([*node.args, *node.keywords], here)

    def _add_looked_up_names(self, node: ast.Call, calls: set[str], here: _Context) -> None:
        """Add the names that a call looks up (``series.agg("mean")``), or doubt if they are unknown."""
        if (
            isinstance(node.func, ast.Name)
            and self._naming.is_own(node.func.id)
            and not self._naming.is_imported(node.func)
        ):
            return
        for words, argument in list_name_arguments(node, calls):
            text = read_constant_text(argument)
            if text is not None:
                self._add_text_name(text, node, here)
            elif not (isinstance(argument, ast.Constant) or self._naming.is_function(argument)):
                self._add_mention("any_name", words, node, here)
        # The argument is data in scikit-learn but may be a name in pandas.
        if "transform" in calls and node.args and self._naming.is_text(node.args[0]):
            self._add_name_or_doubt("transform", read_constant_text(node.args[0]), node, here)

    def _add_name_or_doubt(self, call: str, text: str | None, node: ast.AST, here: _Context) -> None:
        if text is None:
            self._add_mention("any_name", call, node, here)
        else:
            self._add_text_name(text, node, here)

    # imports

    def _visit_import(self, node: ast.Import, here: _Context) -> None:
        for alias in node.names:
            self._add_import(alias.name, node, here)

    def _visit_import_from(self, node: ast.ImportFrom, here: _Context) -> None:
        self._add_import(node.module or "", node, here)
        for alias in node.names:
            whole = f"{node.module or ''}.{alias.name}"
            self._add_mention("import", whole, node, here)
            self._add_mention("taken", alias.name, node, here)
            if alias.name in DOUBTFUL or is_doubtful_import(whole):
                self._add_mention("doubt", whole, node, here)
            if alias.asname not in (None, alias.name):
                self._add_mention("handed_on", alias.name, node, here)

    def _add_import(self, module: str, node: ast.AST, here: _Context) -> None:
        self._add_mention("import", module, node, here)
        self._add_mention("doubt", self._doubt_about(module), node, here)

    # texts that are run

    def _walk_text(self, source: str | bytes, line: int, here: _Context) -> bool:
        """Walk through a text that is run as Python, at its place. Return whether it could be parsed."""
        if self._depth >= _MAX_TEXT_DEPTH:
            return False
        try:
            tree = ast.parse(source)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            return False
        ast.increment_lineno(tree, line - 1)
        self._naming.record_names(tree)
        self.made |= collect_defined_names(tree)
        self._depth += 1
        self._walk_block(tree.body, here)
        self._depth -= 1
        return True

    def _visit_magic_call(self, call: str, texts: list[str | None], node: ast.Call, here: _Context) -> None:
        known = [text for text in texts if text is not None]
        if not texts or len(known) < len(texts) or node.keywords:
            self._add_mention("any_name", call, node, here)
            return
        self._understood.add(node.func)
        if call == "magic":
            known = list(known[0].partition(" ")[::2])
        name, line, body = (*known, "", "")[:3]
        self._visit_magic(name.lstrip("%"), line, body if call == "run_cell_magic" else None, node.lineno, here)

    def _visit_magic(self, name: str, line: str, body: str | None, number: int, here: _Context) -> None:
        """Walk through the code that a magic runs: expressions in its line; for some magics the line or the cell."""
        place = ast.Pass(lineno=number)
        expressions = list(cell_source.list_expressions(line))
        readable = [self._walk_text(expression.lstrip(" \t"), number, here) for expression in expressions]
        if name in cell_source.LINE_WRAPPERS and body is None:
            if expressions:
                self._add_mention("any_name", f"a value in the line of %{name}", place, here)
            readable.append(self._walk_text(cell_source.extract_wrapped_code(line).lstrip(" \t"), number, here))
        elif name in cell_source.WRAPPERS and body is not None:
            inner = cell_source.parse_cell_magic(body)
            if inner is not None:
                self._visit_magic(inner.name, inner.line, inner.body, number + inner.number, here)
            else:
                readable.append(self._walk_text(cell_source.convert_to_python(body), number + 1, here))
        elif name == "run" and body is None:
            self._add_mention("import", line.split()[0].removesuffix(".py") if line.split() else "", place, here)
        elif name in ("writefile", "file") and body is not None:
            self.written.append(("".join(line.split()[-1:]).strip("'\""), body))
        if not all(readable):
            self._add_mention("any_name", f"the text of a magic called {name}", place, here)


def _remove_indent(source: str | bytes, calls: set[str]) -> str | bytes:
    """Remove the leading blanks and tabs of a text as ``eval`` does; ``exec`` and ``compile`` refuse them."""
    if "eval" not in calls:
        return source
    return source.lstrip(" \t") if isinstance(source, str) else source.lstrip(b" \t")


_VISITORS: Mapping[type[ast.AST], Callable[[SyntaxWalker, Any, _Context], None]] = {
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
