"""Adds the names, imports and doubts of single nodes of a syntax tree to the contents of the file."""

from __future__ import annotations

import ast
from collections.abc import Callable

from .contents import CodeContents, Context
from .lookups import list_name_arguments
from .node_properties import is_doubtful_import, read_constant_text
from .scopes import SymbolTable
from .vocabulary import DOUBTFUL, DOUBTFUL_ALONE, DOUBTFUL_METHODS, MAGICS, NAME_TAKERS, RUNNERS, TABLES


class NameRecorder(CodeContents):
    """Adds what single nodes name, import or hide; visits no nodes inside them."""

    def __init__(self, doubt_about: Callable[[str], str]) -> None:
        """Start with no contents. ``doubt_about`` returns the doubt about importing a module as text, or ""."""
        super().__init__()
        self._doubt_about = doubt_about
        self._naming = SymbolTable()
        self._understood: set[ast.AST] = set()  # doubtful nodes with visible arguments

    def _doubt_name_taker(self, names: list[str], node: ast.AST, context: Context) -> None:
        """Add doubt for a function such as ``getattr`` passed on (``map(getattr, ...)``): it may look up any name."""
        for function_name in {name.rpartition(".")[2] for name in names} & NAME_TAKERS:
            self._add_mention("any_name", function_name, node, context)

    def _doubt_chain(self, names: list[str], node: ast.AST, context: Context) -> None:
        doubtful_names = DOUBTFUL_ALONE if isinstance(node, ast.Name) else DOUBTFUL_METHODS
        last_parts = [name.rpartition(".")[2] for name in names]
        doubtful = next(
            (last for last in last_parts if last in DOUBTFUL), last_parts[0] if last_parts[0] in doubtful_names else ""
        )
        if doubtful:
            self._add_mention("any_name" if doubtful in TABLES | RUNNERS | MAGICS else "doubt", doubtful, node, context)
        elif "sys.modules" in names:
            self._add_mention("doubt", "sys.modules", node, context)
        elif self._naming.may_be_imported(node):
            self._add_mention("doubt", next(filter(is_doubtful_import, names), ""), node, context)

    def _add_table_lookup(self, table: ast.expr, key: ast.expr, node: ast.AST, context: Context) -> None:
        """Add the name looked up in a table (``globals()["say"]``), if the text shows both."""
        table_node = table.func if isinstance(table, ast.Call) else table
        names = self._naming.resolve_names(table_node)
        text = read_constant_text(key)
        if text is None:
            return
        if "sys.modules" in names:
            self._add_mention("import", text, node, context)
        elif any(name.rpartition(".")[2] in TABLES for name in names):
            self._add_text_name(text, node, context)
        else:
            return
        self._understood.add(table_node)

    def _add_looked_up_names(self, node: ast.Call, calls: set[str], context: Context) -> None:
        """Add the names that a call looks up (``series.agg("mean")``), or doubt if they are unknown."""
        if (
            isinstance(node.func, ast.Name)
            and self._naming.is_own(node.func.id)
            and not self._naming.is_imported(node.func)
        ):
            return
        for description, argument in list_name_arguments(node, calls):
            text = read_constant_text(argument)
            if text is not None:
                self._add_text_name(text, node, context)
            elif not (isinstance(argument, ast.Constant) or self._naming.is_function(argument)):
                self._add_mention("any_name", description, node, context)
        # The argument is data in scikit-learn but may be a name in pandas.
        if "transform" in calls and node.args and self._naming.is_text(node.args[0]):
            self._add_name_or_doubt("transform", read_constant_text(node.args[0]), node, context)

    def _visit_import(self, node: ast.Import, context: Context) -> None:
        for alias in node.names:
            self._add_import(alias.name, node, context)

    def _visit_import_from(self, node: ast.ImportFrom, context: Context) -> None:
        self._add_import(node.module or "", node, context)
        for alias in node.names:
            full_name = f"{node.module or ''}.{alias.name}"
            self._add_mention("import", full_name, node, context)
            self._add_mention("taken", alias.name, node, context)
            if alias.name in DOUBTFUL or is_doubtful_import(full_name):
                self._add_mention("doubt", full_name, node, context)
            if alias.asname not in (None, alias.name):
                self._add_mention("handed_on", alias.name, node, context)

    def _add_import(self, module: str, node: ast.AST, context: Context) -> None:
        self._add_mention("import", module, node, context)
        self._add_mention("doubt", self._doubt_about(module), node, context)
