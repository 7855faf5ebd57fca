"""Names in a Python file: aliases of imported objects, and the names that the file defines itself.

It follows the text of assignments and imports, not values.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from .lookups import is_text_expression
from .node_properties import collect_bound_names, find_dotted_name, find_root_name
from .vocabulary import TABLE_CALLS

_MAX_NAMES = 8


@dataclass(slots=True)
class _Scope:
    """A scope and its names: all, those bound before the current place, and those bound on every path to it."""

    kind: str  # module, class, function, comprehension
    bound: set[str] = field(default_factory=set)
    bound_so_far: set[str] = field(default_factory=set)
    always_bound: set[str] = field(default_factory=set)


class SymbolTable:
    """The names of one file during a walk."""

    def __init__(self) -> None:
        self._scopes = [_Scope("module")]
        self._aliases: dict[str, set[str]] = {}
        self._imported: set[str] = set()
        self._functions: set[str] = set()
        self._texts: set[str] = set()
        #: Names that other scopes may bind or unbind.
        self._unsure: set[str] = set()

    def record_names(self, tree: ast.Module) -> None:
        """Record all assignments and imports of a tree, before the walk."""
        for node in ast.walk(tree):
            match node:
                case ast.Import(names=aliases):
                    for alias in aliases:
                        bound_name = alias.asname or alias.name.partition(".")[0]
                        self._record_alias(bound_name, alias.name if alias.asname else bound_name, is_imported=True)
                case ast.ImportFrom(module=module, names=aliases):
                    for alias in aliases:
                        self._record_alias(alias.asname or alias.name, f"{module or ''}.{alias.name}", is_imported=True)
                case ast.Assign(targets=targets, value=value):
                    for target in targets:
                        self._record_assignment(target, value)
                case ast.NamedExpr(target=target, value=value):
                    self._record_assignment(target, value)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    self._record_assignment(target, value)
                case ast.arguments():
                    self._record_defaults(node)
                case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                    self._functions.add(name)
                case ast.Global(names=names):
                    self._unsure |= set(names)
                case ast.Delete(targets=deleted):
                    self._unsure |= {target.id for target in deleted if isinstance(target, ast.Name)}
        self._scopes[0].bound |= collect_bound_names(tree.body)

    def resolve_names(self, node: ast.AST) -> list[str]:
        """Return the dotted name of a chain, followed by its names with the first part replaced by known aliases."""
        names = [find_dotted_name(node)]
        pending_names = list(names) if find_root_name(node) else []
        while pending_names and len(names) < _MAX_NAMES:
            root, dot, rest = pending_names.pop().partition(".")
            for target in sorted(self._aliases.get(root, ())):
                full_name = f"{target}{dot}{rest}"
                if full_name not in names:
                    names.append(full_name)
                    # A name assigned from its own part (x = x.next) would loop forever.
                    pending_names += [full_name] if target.partition(".")[0] != root else []
        return names

    def is_imported(self, node: ast.AST) -> bool:
        """Return whether a chain begins with an imported name."""
        return find_root_name(node) in self._imported

    def may_be_imported(self, node: ast.AST) -> bool:
        """Return whether a chain begins with an imported name or an alias of one."""
        return any(
            name.partition(".")[0] in self._imported for name in self.resolve_names(node) if find_root_name(node)
        )

    def is_text(self, node: ast.AST) -> bool:
        """Return whether an expression is a text, or the name of one."""
        return is_text_expression(node) or (
            isinstance(node, ast.Name) and not self._texts.isdisjoint(self.resolve_names(node))
        )

    def is_function(self, node: ast.AST) -> bool:
        """Return whether an expression is a lambda, or names a function of this file, of a module or of Python."""
        if not isinstance(node, ast.Name | ast.Attribute):
            return isinstance(node, ast.Lambda)
        names = self.resolve_names(node)
        if self.is_text(node) or not find_root_name(node):
            return False
        is_own = any(name.rpartition(".")[2] in self._functions for name in names)
        return is_own or self.may_be_imported(node) or hasattr(builtins, find_root_name(node))

    def is_own(self, name: str) -> bool | None:
        """Return whether a name read here is defined by this file; None if unknown."""
        is_later = False
        for scope in reversed(self._scopes[1:]):
            if scope.kind == "class":
                if scope is self._scopes[-1] and name in scope.bound_so_far:
                    return True if name in scope.always_bound else None
                continue
            if name in scope.bound:
                return True
            is_later = is_later or scope.kind == "function"
        module = self._scopes[0]
        if name in module.always_bound and name not in self._unsure:
            return True
        is_unsure = name in module.bound_so_far or (is_later and (name in module.bound or name in self._unsure))
        return None if is_unsure else False

    @contextlib.contextmanager
    def scope(self, kind: str, bound_names: set[str] | None = None) -> Iterator[None]:
        """Enter a new scope. ``bound_names`` are the names that it binds anywhere."""
        self._scopes.append(_Scope(kind, bound_names or set()))
        yield
        self._scopes.pop()

    @contextlib.contextmanager
    def block(self) -> Iterator[None]:
        """Enter code that may not run. The names that it binds are not sure after it."""
        scope = self._scopes[-1]
        sure_names = set(scope.always_bound)
        yield
        scope.always_bound = sure_names

    def bind(self, names: set[str], *, is_sure: bool = True) -> None:
        """Mark these names as bound from here on, or possibly bound."""
        scope = self._scopes[-1]
        scope.bound_so_far |= names
        if is_sure:
            scope.always_bound |= names

    def _record_alias(self, name: str, target: str, *, is_imported: bool = False) -> None:
        self._aliases.setdefault(name, set()).add(target)
        if is_imported:
            self._imported.add(name)

    def _record_assignment(self, target: ast.AST, value: ast.AST) -> None:
        if isinstance(target, ast.Tuple | ast.List) and isinstance(value, ast.Tuple | ast.List):
            for target_part, value_part in zip(target.elts, value.elts, strict=False):
                self._record_assignment(target_part, value_part)
        elif isinstance(target, ast.Name):
            if isinstance(value, ast.Call) and find_dotted_name(value.func) in TABLE_CALLS:
                self._record_alias(target.id, find_dotted_name(value.func))
            elif find_root_name(value):
                self._record_alias(target.id, find_dotted_name(value))
            elif isinstance(value, ast.Lambda):
                self._functions.add(target.id)
            elif is_text_expression(value):
                self._texts.add(target.id)

    def _record_defaults(self, arguments: ast.arguments) -> None:
        positional = [*arguments.posonlyargs, *arguments.args]
        optional = positional[len(positional) - len(arguments.defaults) :]
        pairs = [*zip(optional, arguments.defaults, strict=True)]
        pairs += [(one, each) for one, each in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if each]
        for argument, default in pairs:
            if find_root_name(default):
                self._record_alias(argument.arg, find_dotted_name(default))
