"""Names in a Python file: aliases of imported objects, and the names that the file defines itself.

It follows the text of assignments and imports, not values.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from .lookups import makes_text
from .names import bound_in, dotted, root
from .vocabulary import TABLE_CALLS

_MOST_NAMES = 8


@dataclass(slots=True)
class _Scope:
    """A scope: names ``bound`` anywhere in it, ``so_far`` before the current place, ``sure`` on every path to it."""

    kind: str  # module, class, function, comprehension
    bound: set[str] = field(default_factory=set)
    so_far: set[str] = field(default_factory=set)
    sure: set[str] = field(default_factory=set)


class Naming:
    """The names of one file during a walk."""

    def __init__(self) -> None:
        self._scopes = [_Scope("module")]
        self._stands_for: dict[str, set[str]] = {}
        self._imported: set[str] = set()
        self._functions: set[str] = set()
        self._texts: set[str] = set()
        #: Names that other scopes may bind or unbind.
        self._unsure: set[str] = set()

    def learn(self, tree: ast.Module) -> None:
        """Record all assignments and imports of a tree, before the walk."""
        for node in ast.walk(tree):
            match node:
                case ast.Import(names=aliases):
                    for alias in aliases:
                        bound = alias.asname or alias.name.partition(".")[0]
                        self._note(bound, alias.name if alias.asname else bound, imported=True)
                case ast.ImportFrom(module=module, names=aliases):
                    for alias in aliases:
                        self._note(alias.asname or alias.name, f"{module or ''}.{alias.name}", imported=True)
                case ast.Assign(targets=targets, value=value):
                    for target in targets:
                        self._assigned(target, value)
                case ast.NamedExpr(target=target, value=value):
                    self._assigned(target, value)
                case ast.AnnAssign(target=target, value=ast.expr() as value):
                    self._assigned(target, value)
                case ast.arguments():
                    self._defaults(node)
                case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                    self._functions.add(name)
                case ast.Global(names=names):
                    self._unsure |= set(names)
                case ast.Delete(targets=deleted):
                    self._unsure |= {target.id for target in deleted if isinstance(target, ast.Name)}
        self._scopes[0].bound |= bound_in(tree.body)

    def names(self, node: ast.AST) -> list[str]:
        """Return the dotted name of a chain, followed by its names with the first part replaced by known aliases."""
        found = [dotted(node)]
        waiting = list(found) if root(node) else []
        while waiting and len(found) < _MOST_NAMES:
            first, dot, rest = waiting.pop().partition(".")
            for other in sorted(self._stands_for.get(first, ())):
                whole = f"{other}{dot}{rest}"
                if whole not in found:
                    found.append(whole)
                    # A name assigned from its own part (x = x.next) would loop forever.
                    waiting += [whole] if other.partition(".")[0] != first else []
        return found

    def is_imported(self, node: ast.AST) -> bool:
        """Return whether a chain begins with an imported name."""
        return root(node) in self._imported

    def may_be_imported(self, node: ast.AST) -> bool:
        """Return whether a chain begins with an imported name or an alias of one."""
        return any(name.partition(".")[0] in self._imported for name in self.names(node) if root(node))

    def is_text(self, node: ast.AST) -> bool:
        """Return whether an expression is a text, or the name of one."""
        return makes_text(node) or (isinstance(node, ast.Name) and not self._texts.isdisjoint(self.names(node)))

    def is_function(self, node: ast.AST) -> bool:
        """Return whether an expression is a lambda, or names a function of this file, of a module or of Python."""
        if not isinstance(node, ast.Name | ast.Attribute):
            return isinstance(node, ast.Lambda)
        names = self.names(node)
        if self.is_text(node) or not root(node):
            return False
        own = any(name.rpartition(".")[2] in self._functions for name in names)
        return own or self.may_be_imported(node) or hasattr(builtins, root(node))

    def own(self, name: str) -> bool | None:
        """Return whether a name read here is defined by this file; None if unknown."""
        later = False
        for scope in reversed(self._scopes[1:]):
            if scope.kind == "class":
                if scope is self._scopes[-1] and name in scope.so_far:
                    return True if name in scope.sure else None
                continue
            if name in scope.bound:
                return True
            later = later or scope.kind == "function"
        module = self._scopes[0]
        if name in module.sure and name not in self._unsure:
            return True
        unsure = name in module.so_far or (later and (name in module.bound or name in self._unsure))
        return None if unsure else False

    @contextlib.contextmanager
    def scope(self, kind: str, bound: set[str] | None = None) -> Iterator[None]:
        """Enter a new scope. ``bound`` are the names that it binds anywhere."""
        self._scopes.append(_Scope(kind, bound or set()))
        yield
        self._scopes.pop()

    @contextlib.contextmanager
    def block(self) -> Iterator[None]:
        """Enter code that may not run. The names that it binds are not sure after it."""
        scope = self._scopes[-1]
        before = set(scope.sure)
        yield
        scope.sure = before

    def bind(self, names: set[str], *, sure: bool = True) -> None:
        """Mark these names as bound from here on, or possibly bound."""
        scope = self._scopes[-1]
        scope.so_far |= names
        if sure:
            scope.sure |= names

    def _note(self, name: str, stands_for: str, *, imported: bool = False) -> None:
        self._stands_for.setdefault(name, set()).add(stands_for)
        if imported:
            self._imported.add(name)

    def _assigned(self, target: ast.AST, value: ast.AST) -> None:
        if isinstance(target, ast.Tuple | ast.List) and isinstance(value, ast.Tuple | ast.List):
            for one, other in zip(target.elts, value.elts, strict=False):
                self._assigned(one, other)
        elif isinstance(target, ast.Name):
            if isinstance(value, ast.Call) and dotted(value.func) in TABLE_CALLS:
                self._note(target.id, dotted(value.func))
            elif root(value):
                self._note(target.id, dotted(value))
            elif isinstance(value, ast.Lambda):
                self._functions.add(target.id)
            elif makes_text(value):
                self._texts.add(target.id)

    def _defaults(self, arguments: ast.arguments) -> None:
        given = [*arguments.posonlyargs, *arguments.args]
        with_default = given[len(given) - len(arguments.defaults) :]
        pairs = [*zip(with_default, arguments.defaults, strict=True)]
        pairs += [(one, each) for one, each in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True) if each]
        for argument, default in pairs:
            if root(default):
                self._note(argument.arg, dotted(default))
