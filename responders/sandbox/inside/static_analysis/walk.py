"""Walks through a syntax tree and records its contents: the place, reachability, and position in a loop.

It executes nothing and applies no rules. ``reader.py`` does.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from .. import cell_source
from .lookups import may_unpickle, name_arguments
from .names import (
    arguments_of,
    blocks,
    bound_in,
    declared_elsewhere,
    ends,
    is_empty,
    leads_to_doubt,
    made_in,
    source_of,
    surely_bound,
    text_of,
    truth,
)
from .scopes import Naming
from .units import Mention, SourcePlace, Unit
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

_DEEPEST = 8
#: Maximum number of places kept per mention.
_MOST_PLACES = 200


class _Here(NamedTuple):
    live: bool = True
    looped: bool = False


class Walk:
    """The contents of one file, or of the cells of one notebook."""

    def __init__(self, doubt_about: Callable[[str], str]) -> None:
        """Start with no contents. ``doubt_about`` returns the doubt about importing a module as text, or ""."""
        self.units: list[Unit] = []
        #: Files that a notebook writes: names and texts.
        self.written: list[tuple[str, str]] = []
        self._doubt_about = doubt_about
        self._naming = Naming()
        self._file = ""
        self._unit = Unit("")
        self._owner = ""
        self._understood: set[ast.AST] = set()  # doubtful nodes with visible arguments
        self._depth = 0
        self._statement = (0, 0)  # start of the current statement
        #: Names that the source defines itself.
        self.made: set[str] = set()

    def read(self, tree: ast.Module, file: str, unit: Unit) -> None:
        """Add the contents of ``tree``. ``file`` is its name in messages."""
        self._begin(file, unit)
        self._naming.learn(tree)
        self.made |= made_in(tree)
        self._statements(tree.body, _Here())

    def read_magic(self, magic: cell_source.CellMagic, file: str, unit: Unit) -> None:
        """Add the contents of a cell magic."""
        self._begin(file, unit)
        self._magic(magic.name, magic.line, magic.body, magic.number, _Here())

    def _begin(self, file: str, unit: Unit) -> None:
        self._file, self._unit = file, unit
        self.units.append(unit)

    def _add(self, kind: str, name: str, node: ast.AST, here: _Here, statement: tuple[int, int] | None = None) -> None:
        """Add a mention. ``statement`` is the start of the statement that has to run for it, or the current one."""
        if name:
            place = SourcePlace(self._file, getattr(node, "lineno", 0), statement or self._statement)
            places = self._unit.mentions.setdefault(Mention(kind, name, here.live, here.looped), [])
            if len(places) < _MOST_PLACES:
                places.append(place)

    def _by_text(self, text: str, node: ast.AST, here: _Here) -> None:
        self._add("handed_on", text, node, here)
        self._add("name", text, node, here)
        for part in sorted(DOUBTFUL.intersection(text.split("."))):
            self._add("any_name" if part in TABLES | RUNNERS | MAGICS else "doubt", part, node, here)

    # statements

    def _statements(self, body: Sequence[ast.stmt], here: _Here) -> None:
        before = self._statement
        for statement in body:
            self._statement = self._beginning(statement)
            self._visit(statement, here)
            if here.live:
                self._naming.bind(surely_bound(statement))
            here = here._replace(live=here.live and not ends(statement))
        self._statement = before

    def _beginning(self, statement: ast.stmt) -> tuple[int, int]:
        """Return the line and column of a statement; inside a text that is run, those of the statement that runs it."""
        return self._statement if self._depth else (statement.lineno, statement.col_offset)

    def _block(self, body: Sequence[ast.stmt], here: _Here, bound: Sequence[ast.AST] = ()) -> None:
        """Walk through a block that may not run. ``bound`` are the nodes whose names it binds first."""
        with self._naming.block():
            if here.live:
                self._naming.bind(bound_in(bound))
            self._statements(body, here)

    def _visit(self, node: ast.AST, here: _Here) -> None:
        construct = CONSTRUCTS.get(type(node))
        if construct is not None:
            # For a loop, its body has to run; for any other statement, the statement itself.
            body = node.body[0] if isinstance(node, ast.For | ast.AsyncFor | ast.While) else None
            self._add("construct", construct, node, here, self._beginning(body) if body else None)
        if isinstance(node, ast.If | ast.For | ast.AsyncFor | ast.While) and node.orelse:
            self._add("construct", "else", node, here, self._beginning(node.orelse[0]))
        _WAYS.get(type(node), Walk._parts)(self, node, here)

    def _parts(self, node: ast.AST, here: _Here) -> None:
        for _, value in ast.iter_fields(node):
            parts = value if isinstance(value, list) else [value]
            if parts and isinstance(parts[0], ast.stmt):
                self._block(parts, here)
            else:
                self._each((part for part in parts if isinstance(part, ast.AST)), here)

    def _each(self, nodes: Iterable[ast.AST | None], here: _Here) -> None:
        for node in nodes:
            if node is not None:
                self._visit(node, here)

    def _if(self, node: ast.If, here: _Here) -> None:
        self._visit(node.test, here)
        for block, live in blocks(node):
            self._block(block, here._replace(live=here.live and live))

    def _while(self, node: ast.While, here: _Here) -> None:
        inside = _Here(here.live and truth(node.test) is not False, True)
        self._visit(node.test, inside)
        self._block(node.body, inside)
        self._block(node.orelse, here)

    def _for(self, node: ast.For | ast.AsyncFor, here: _Here) -> None:
        self._each((node.iter, node.target), here)
        self._block(node.body, _Here(here.live and not is_empty(node.iter), True), [node.target])
        self._block(node.orelse, here)

    def _with(self, node: ast.With | ast.AsyncWith, here: _Here) -> None:
        self._each(node.items, here)
        self._block(node.body, here, node.items)

    def _handler(self, node: ast.ExceptHandler, here: _Here) -> None:
        self._each([node.type], here)
        self._block(node.body, here, [ast.Name(node.name, ast.Store())] if node.name else [])

    def _case(self, node: ast.match_case, here: _Here) -> None:
        self._each((node.pattern, node.guard), here)
        self._block(node.body, here, [node.pattern])

    def _class_pattern(self, node: ast.MatchClass, here: _Here) -> None:
        for attribute in node.kwd_attrs:
            self._by_text(attribute, node, here)
        self._parts(node, here)

    def _function(self, node: ast.FunctionDef | ast.AsyncFunctionDef, here: _Here) -> None:
        self._add("function", node.name, node, here)
        if node.name in DOUBTFUL and node.name.startswith("__"):
            self._add("doubt", node.name, node, here)
        # Defaults and annotations are evaluated where the function is defined.
        self._each([*node.decorator_list, node.args, node.returns], here)
        within = Unit(node.name, self._owner, self._unit, here.live, bool(node.decorator_list))
        self.units.append(within)
        self._unit.units.append(within)
        around = self._unit, self._owner
        self._unit, self._owner = within, ""
        bound = arguments_of(node) | bound_in(node.body) - declared_elsewhere(node)
        with self._naming.scope("function", bound):
            self._statements(node.body, _Here())
        self._unit, self._owner = around

    def _lambda(self, node: ast.Lambda, here: _Here) -> None:
        self._visit(node.args, here)
        with self._naming.scope("function", arguments_of(node)):
            self._visit(node.body, here)

    def _class(self, node: ast.ClassDef, here: _Here) -> None:
        self._each([*node.decorator_list, *node.bases, *node.keywords], here)
        owner, self._owner = self._owner, node.name
        with self._naming.scope("class"):
            self._statements(node.body, here)
        self._owner = owner

    # expressions

    def _comprehension(self, node: Any, here: _Here) -> None:
        first, *others = node.generators
        self._visit(first.iter, here)
        inside = _Here(here.live and not is_empty(first.iter), True)
        with self._naming.scope("comprehension", bound_in([each.target for each in node.generators])):
            self._each([first.target, *first.ifs, *others], inside)
            self._each([getattr(node, name, None) for name in ("elt", "key", "value")], inside)

    def _either(self, node: ast.IfExp, here: _Here) -> None:
        known = truth(node.test)
        self._visit(node.test, here)
        self._visit(node.body, here._replace(live=here.live and known is not False))
        self._visit(node.orelse, here._replace(live=here.live and known is not True))

    def _walrus(self, node: ast.NamedExpr, here: _Here) -> None:
        self._each((node.value, node.target), here)
        if here.live:
            self._naming.bind({node.target.id}, sure=False)

    def _and_or(self, node: ast.BoolOp, here: _Here) -> None:
        decides = isinstance(node.op, ast.Or)
        for value in node.values:
            self._visit(value, here)
            here = here._replace(live=here.live and truth(value) is not decides)

    def _chain(self, node: ast.Name | ast.Attribute, here: _Here, kind: str = "handed_on") -> None:
        """Add a name or a dotted name. ``kind`` says how it is used."""
        names = self._naming.names(node)
        own = self._naming.own(node.id) if isinstance(node, ast.Name) else False
        for name in names:
            self._add("name", name, node, here)
            if kind == "call":
                self._add(kind, name, node, here)
            elif isinstance(node.ctx, ast.Load) and own is not True:
                self._add("unsure" if own is None else kind, name, node, here)
        if isinstance(node, ast.Attribute):
            if self._naming.is_imported(node):
                self._add("through", names[-1], node, here)
            self._before_dot(node.value, here)
        if isinstance(node.ctx, ast.Load) and kind != "call" and (own is not True or self._naming.is_imported(node)):
            self._doubt_name_taker(names, node, here)
        if own is not True and node not in self._understood:
            self._doubt_chain(names, node, here)

    def _doubt_name_taker(self, names: list[str], node: ast.AST, here: _Here) -> None:
        """Add doubt for a function such as ``getattr`` passed on (``map(getattr, ...)``): it may look up any name."""
        for last in {name.rpartition(".")[2] for name in names} & NAME_TAKERS:
            self._add("any_name", last, node, here)

    def _before_dot(self, node: ast.expr, here: _Here) -> None:
        if isinstance(node, ast.Name | ast.Attribute):
            self._chain(node, here, "base")
        else:
            self._visit(node, here)

    def _doubt_chain(self, names: list[str], node: ast.AST, here: _Here) -> None:
        alone = DOUBTFUL_ALONE if isinstance(node, ast.Name) else DOUBTFUL_METHODS
        lasts = [name.rpartition(".")[2] for name in names]
        doubtful = next((last for last in lasts if last in DOUBTFUL), lasts[0] if lasts[0] in alone else "")
        if doubtful:
            self._add("any_name" if doubtful in TABLES | RUNNERS | MAGICS else "doubt", doubtful, node, here)
        elif "sys.modules" in names:
            self._add("doubt", "sys.modules", node, here)
        elif self._naming.may_be_imported(node):
            self._add("doubt", next(filter(leads_to_doubt, names), ""), node, here)

    def _index(self, node: ast.Subscript, here: _Here) -> None:
        self._ask_table(node.value, node.slice, node, here)
        self._parts(node, here)

    def _ask_table(self, table: ast.expr, key: ast.expr, node: ast.AST, here: _Here) -> None:
        """Add the name looked up in a table (``globals()["say"]``), if the text shows both."""
        named = table.func if isinstance(table, ast.Call) else table
        names = self._naming.names(named)
        text = text_of(key)
        if text is None:
            return
        if "sys.modules" in names:
            self._add("import", text, node, here)
        elif any(name.rpartition(".")[2] in TABLES for name in names):
            self._by_text(text, node, here)
        else:
            return
        self._understood.add(named)

    def _call(self, node: ast.Call, here: _Here) -> None:
        function = node.func
        calls = {name.rpartition(".")[2] for name in self._naming.names(function)}
        texts = [text_of(argument) for argument in node.args]
        if isinstance(function, ast.Attribute) and function.attr in GETTERS and node.args:
            self._ask_table(function.value, node.args[0], node, here)
        for call in sorted(calls & TAKES_NAME.keys()):
            place = TAKES_NAME[call]
            is_known = len(texts) > place and not any(isinstance(each, ast.Starred) for each in node.args[:place])
            self._take(call, texts[place] if is_known else None, node, here)
        for call in sorted(calls & TAKES_NAMES):
            for argument, text in zip(node.args, texts, strict=True):
                if text is not None or not isinstance(argument, ast.Constant):
                    self._take(call, text, node, here)
        named = next((text for text in texts if text), None)
        if calls & IMPORTERS and named is not None:
            if texts[0] is not None:
                self._understood.add(function)
            self._add("import", named.replace(":", "."), node, here)
        source = source_of(node.args[0]) if calls & RUNNERS and node.args else None
        if source is not None and self._run_text(_without_indent(source, calls), node.lineno, here):
            self._understood.add(function)
        if may_unpickle(node, calls):
            self._add("doubt", "allow_pickle", node, here)
        self._look_up_names(node, calls, here)
        for call in sorted(calls & MAGICS):
            self._call_magic(call, texts, node, here)
        if isinstance(function, ast.Name | ast.Attribute):
            self._chain(function, here, "call")
        else:
            self._visit(function, here)
        self._each([*node.args, *node.keywords], here)

    def _look_up_names(self, node: ast.Call, calls: set[str], here: _Here) -> None:
        """Add the names that a call looks up (``series.agg("mean")``), or doubt if they are unknown."""
        if (
            isinstance(node.func, ast.Name)
            and self._naming.own(node.func.id)
            and not self._naming.is_imported(node.func)
        ):
            return
        for words, argument in name_arguments(node, calls):
            text = text_of(argument)
            if text is not None:
                self._by_text(text, node, here)
            elif not (isinstance(argument, ast.Constant) or self._naming.is_function(argument)):
                self._add("any_name", words, node, here)
        # The argument is data in scikit-learn but may be a name in pandas.
        if "transform" in calls and node.args and self._naming.is_text(node.args[0]):
            self._take("transform", text_of(node.args[0]), node, here)

    def _take(self, call: str, text: str | None, node: ast.AST, here: _Here) -> None:
        if text is None:
            self._add("any_name", call, node, here)
        else:
            self._by_text(text, node, here)

    # imports

    def _import(self, node: ast.Import, here: _Here) -> None:
        for alias in node.names:
            self._import_module(alias.name, node, here)

    def _import_from(self, node: ast.ImportFrom, here: _Here) -> None:
        self._import_module(node.module or "", node, here)
        for alias in node.names:
            whole = f"{node.module or ''}.{alias.name}"
            self._add("import", whole, node, here)
            self._add("taken", alias.name, node, here)
            if alias.name in DOUBTFUL or leads_to_doubt(whole):
                self._add("doubt", whole, node, here)
            if alias.asname not in (None, alias.name):
                self._add("handed_on", alias.name, node, here)

    def _import_module(self, module: str, node: ast.AST, here: _Here) -> None:
        self._add("import", module, node, here)
        self._add("doubt", self._doubt_about(module), node, here)

    # texts that are run

    def _run_text(self, source: str | bytes, line: int, here: _Here) -> bool:
        """Walk through a text that is run as Python, at its place. Return whether it could be parsed."""
        if self._depth >= _DEEPEST:
            return False
        try:
            tree = ast.parse(source)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            return False
        ast.increment_lineno(tree, line - 1)
        self._naming.learn(tree)
        self.made |= made_in(tree)
        self._depth += 1
        self._block(tree.body, here)
        self._depth -= 1
        return True

    def _call_magic(self, call: str, texts: list[str | None], node: ast.Call, here: _Here) -> None:
        known = [text for text in texts if text is not None]
        if not texts or len(known) < len(texts) or node.keywords:
            self._add("any_name", call, node, here)
            return
        self._understood.add(node.func)
        if call == "magic":
            known = list(known[0].partition(" ")[::2])
        name, line, body = (*known, "", "")[:3]
        self._magic(name.lstrip("%"), line, body if call == "run_cell_magic" else None, node.lineno, here)

    def _magic(self, name: str, line: str, body: str | None, number: int, here: _Here) -> None:
        """Walk through the code that a magic runs: expressions in its line; for some magics the line or the cell."""
        place = ast.Pass(lineno=number)
        expressions = list(cell_source.expressions(line))
        readable = [self._run_text(expression.lstrip(" \t"), number, here) for expression in expressions]
        if name in cell_source.LINE_WRAPPERS and body is None:
            if expressions:
                self._add("any_name", f"a value in the line of %{name}", place, here)
            readable.append(self._run_text(cell_source.wrapped(line).lstrip(" \t"), number, here))
        elif name in cell_source.WRAPPERS and body is not None:
            inner = cell_source.cell_magic(body)
            if inner is not None:
                self._magic(inner.name, inner.line, inner.body, number + inner.number, here)
            else:
                readable.append(self._run_text(cell_source.python_source(body), number + 1, here))
        elif name == "run" and body is None:
            self._add("import", line.split()[0].removesuffix(".py") if line.split() else "", place, here)
        elif name in ("writefile", "file") and body is not None:
            self.written.append(("".join(line.split()[-1:]).strip("'\""), body))
        if not all(readable):
            self._add("any_name", f"the text of a magic called {name}", place, here)


def _without_indent(source: str | bytes, calls: set[str]) -> str | bytes:
    """Remove the leading blanks and tabs of a text as ``eval`` does; ``exec`` and ``compile`` refuse them."""
    if "eval" not in calls:
        return source
    return source.lstrip(" \t") if isinstance(source, str) else source.lstrip(b" \t")


_WAYS: Mapping[type[ast.AST], Callable[[Walk, Any, _Here], None]] = {
    ast.If: Walk._if,
    ast.While: Walk._while,
    ast.For: Walk._for,
    ast.AsyncFor: Walk._for,
    ast.With: Walk._with,
    ast.AsyncWith: Walk._with,
    ast.ExceptHandler: Walk._handler,
    ast.match_case: Walk._case,
    ast.MatchClass: Walk._class_pattern,
    ast.FunctionDef: Walk._function,
    ast.AsyncFunctionDef: Walk._function,
    ast.Lambda: Walk._lambda,
    ast.ClassDef: Walk._class,
    ast.ListComp: Walk._comprehension,
    ast.SetComp: Walk._comprehension,
    ast.DictComp: Walk._comprehension,
    ast.GeneratorExp: Walk._comprehension,
    ast.IfExp: Walk._either,
    ast.NamedExpr: Walk._walrus,
    ast.BoolOp: Walk._and_or,
    ast.Name: Walk._chain,
    ast.Attribute: Walk._chain,
    ast.Subscript: Walk._index,
    ast.Call: Walk._call,
    ast.Import: Walk._import,
    ast.ImportFrom: Walk._import_from,
}
