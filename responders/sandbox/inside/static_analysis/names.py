"""What a piece of Python's syntax is by itself: its dotted name, the text it comes to, whether it is ever run.

Nothing is looked up and nothing is run; what a whole file has in it is ``walk.py``'s.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Sequence, Set

from .vocabulary import DOUBTFUL_PARTS, PLAIN_MODULES

_MOST_PARTS = 10
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_LEAVES = frozenset({"sys.exit", "os._exit", "os.abort"})


def dotted(node: ast.AST) -> str:
    """``tank_drive.on`` for a chain of names; the names behind the last call or index of any other chain."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute) and len(parts) < _MOST_PARTS:
        parts.append(node.attr)
        node = node.value
    if isinstance(node, ast.Name):
        parts.append(node.id)
    return ".".join(reversed(parts))


def root(node: ast.AST) -> str:
    """The name that a chain begins with; empty if it begins with a call or the like."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def leads_to_doubt(name: str) -> bool:
    """Whether a dotted name of something imported leads through its module to another that is doubtful.

    What a plain module keeps for itself, with an underscore, may run a text or take any name.
    """
    top, *parts = name.split(".")
    if top in PLAIN_MODULES and any(map(_is_private, parts)):
        return True
    top = top.lstrip("_")
    doubtful = DOUBTFUL_PARTS | (sys.stdlib_module_names - PLAIN_MODULES if top in sys.stdlib_module_names else set())
    return not doubtful.isdisjoint(part.lstrip("_") for part in parts)


def _is_private(name: str) -> bool:
    """Whether a name begins with an underscore and is none of Python's own, such as ``__name__``."""
    return name.startswith("_") and not (name.startswith("__") and name.endswith("__"))


def text_of(node: ast.AST) -> str | None:
    """Return ``source_of`` as text, with bytes decoded as Latin-1."""
    source = source_of(node)
    return source.decode("latin-1") if isinstance(source, bytes) else source


def source_of(node: ast.AST) -> str | bytes | None:
    """Return the text or bytes of a constant, or of constants joined by ``+`` or in an f-string."""
    match node:
        case ast.Constant(value=str() | bytes() as source):
            return source
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return _joined((left, right))
        case ast.JoinedStr(values=values):
            return _joined(values)
        case ast.FormattedValue(value=value, conversion=-1, format_spec=None):
            text = source_of(value)
            return text if isinstance(text, str) else None
    return None


def _joined(nodes: Sequence[ast.AST]) -> str | bytes | None:
    sources = [source_of(node) for node in nodes]
    texts = [source for source in sources if isinstance(source, str)]
    if len(texts) == len(sources):
        return "".join(texts)
    data = [source for source in sources if isinstance(source, bytes)]
    return b"".join(data) if len(data) == len(sources) else None


def truth(node: ast.AST) -> bool | None:
    """Whether a condition of constants holds; None where that is only known when it is run."""
    match node:
        case ast.Constant(value=value):
            return bool(value)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            known = truth(operand)
            return None if known is None else not known
        case ast.BoolOp(op=operator, values=values):
            decides = isinstance(operator, ast.Or)
            known_values = [truth(value) for value in values]
            if decides in known_values:
                return decides
            return None if None in known_values else not decides
        case ast.List(elts=[]) | ast.Tuple(elts=[]) | ast.Dict(keys=[]):
            return False
        case ast.Compare(left=ast.Constant(value=left), ops=[operator], comparators=[ast.Constant(value=right)]):
            return _compared(left, operator, right)
    return None


def _compared(left: object, operator: ast.cmpop, right: object) -> bool | None:
    try:
        match operator:
            case ast.Eq():
                return left == right
            case ast.NotEq():
                return left != right
            case ast.Lt():
                return bool(left < right)  # type: ignore[operator]
            case ast.LtE():
                return bool(left <= right)  # type: ignore[operator]
            case ast.Gt():
                return bool(left > right)  # type: ignore[operator]
            case ast.GtE():
                return bool(left >= right)  # type: ignore[operator]
    except TypeError:
        pass
    return None


def is_empty(node: ast.AST) -> bool:
    """Whether a loop over it is never entered."""
    match node:
        case ast.Call(func=ast.Name(id="range"), args=arguments, keywords=[]):
            values = [each.value if isinstance(each, ast.Constant) else None for each in arguments]
            numbers = [value for value in values if isinstance(value, int)]
            return (
                0 < len(numbers) == len(values) <= 3 and (len(numbers) < 3 or numbers[2] != 0) and not range(*numbers)
            )
        case ast.Constant(value=str() | bytes()) | ast.List() | ast.Tuple() | ast.Dict():
            return truth(node) is False
    return False


def ends(statement: ast.stmt) -> bool:
    """Whether nothing below it in the same block is ever come to."""
    match statement:
        case ast.Return() | ast.Raise() | ast.Break() | ast.Continue():
            return True
        case ast.Expr(value=ast.Call(func=function)):
            return dotted(function) in _LEAVES
        case ast.If(test=test, body=body, orelse=orelse):
            ways = {True: (body,), False: (orelse,), None: (body, orelse)}[truth(test)]
            return all(any(map(ends, way)) for way in ways)
        case ast.While(test=test):
            return truth(test) is True and not any(isinstance(each, ast.Break) for each in ast.walk(statement))
    return False


def blocks(statement: ast.AST) -> Iterator[tuple[list[ast.stmt], bool]]:
    """The blocks of a compound statement, and whether each may be come to."""
    match statement:
        case ast.If(test=test, body=body, orelse=orelse):
            yield body, truth(test) is not False
            yield orelse, truth(test) is not True
        case ast.While(test=test, body=body, orelse=orelse):
            yield body, truth(test) is not False
            yield orelse, True
        case ast.For(iter=over, body=body, orelse=orelse) | ast.AsyncFor(iter=over, body=body, orelse=orelse):
            yield body, not is_empty(over)
            yield orelse, True
        case _:
            for _, value in ast.iter_fields(statement):
                if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                    yield value, True


def bound_in(body: Sequence[ast.AST]) -> set[str]:
    """The names that a scope's own code binds, wherever in it; not what is bound in functions and classes inside.

    Code that is never come to binds nothing.
    """
    names: set[str] = set()
    waiting = list(reversed(body))
    while waiting:
        node = waiting.pop()
        names |= bound_by(node)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            continue
        if isinstance(node, (ast.Lambda, *_COMPREHENSIONS)):
            names |= {each.target.id for each in ast.walk(node) if isinstance(each, ast.NamedExpr)}
            continue
        dead = {id(statement) for block, live in blocks(node) if not live for statement in block}
        waiting += [child for child in ast.iter_child_nodes(node) if id(child) not in dead]
    return names


def bound_by(node: ast.AST) -> set[str]:
    """The names that a single node binds."""
    match node:
        case ast.Name(id=name, ctx=ast.Store()):
            return {name}
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            return {name}
        case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
            return {(alias.asname or alias.name).partition(".")[0] for alias in aliases}
        case (
            ast.ExceptHandler(name=str() as name) | ast.MatchAs(name=str() as name) | ast.MatchStar(name=str() as name)
        ):
            return {name}
        case ast.MatchMapping(rest=str() as name):
            return {name}
        case ast.arg(arg=name):
            return {name}
    return set()


def made_in(tree: ast.Module) -> set[str]:
    """The names that a text gives to something of its own: functions, classes, values.

    Not to what it has from elsewhere: something imported by its name, an instance of a class that is not its own.
    """
    nodes = list(ast.walk(tree))
    made = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)}
    for node in nodes:
        match node:
            case ast.Assign(targets=targets, value=value):
                made |= {name for target in targets for name in _made_by(target, value, made)}
            case ast.AnnAssign(target=target, value=ast.expr() as value) | ast.NamedExpr(target=target, value=value):
                made |= _made_by(target, value, made)
            case ast.For(target=target) | ast.AsyncFor(target=target):
                made |= bound_in([target])
            case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
                made |= {each.asname for each in aliases if each.asname and not _is_last(each.name, each.asname)}
    return made


def _made_by(target: ast.expr, value: ast.expr, made: Set[str]) -> set[str]:
    match target, value:
        case ((ast.Tuple(elts=targets) | ast.List(elts=targets)), (ast.Tuple(elts=values) | ast.List(elts=values))):
            pairs = zip(targets, values, strict=False)
            return {name for one, other in pairs for name in _made_by(one, other, made)}
        case ast.Name(id=name), ast.Call(func=function):
            kind = dotted(function).rpartition(".")[2]
            is_instance = kind[:1].isupper() and kind not in made and root(function) not in made
            return set() if is_instance else {name}
        case ast.Name(id=name), ast.Attribute():
            return set() if _is_last(dotted(value), name) and root(value) not in made else {name}
    return bound_in([target])


def _is_last(dotted_name: str, name: str) -> bool:
    return dotted_name.rpartition(".")[2] == name


def surely_bound(statement: ast.stmt) -> set[str]:
    """The names that have a value once a statement has been run."""
    match statement:
        case ast.Assign(targets=targets):
            return bound_in(targets)
        case ast.AugAssign(target=target) | ast.AnnAssign(target=target, value=ast.expr()):
            return bound_in([target])
    return bound_by(statement)


def arguments_of(function: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) -> set[str]:
    """The names of all parameters, those with stars too."""
    return {each.arg for each in ast.iter_child_nodes(function.args) if isinstance(each, ast.arg)}


def declared_elsewhere(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    """The names that a function says are not its own."""
    found = (node.names for node in ast.walk(function) if isinstance(node, ast.Global | ast.Nonlocal))
    return {name for names in found for name in names}
