"""Properties of single syntax nodes: dotted name, constant text, bound names, reachability.

Nothing is resolved or executed. ``syntax_walker.py`` analyses whole files.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator, Sequence, Set

from .vocabulary import DOUBTFUL_PARTS, PLAIN_MODULES

_MAX_PARTS = 10
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_EXIT_FUNCTIONS = frozenset({"sys.exit", "os._exit", "os.abort"})


def find_dotted_name(node: ast.AST) -> str:
    """Return the dotted name of a chain, such as ``tank_drive.on``.

    For a chain with a call or an index, return the names after the last one.
    """
    parts: list[str] = []
    while isinstance(node, ast.Attribute) and len(parts) < _MAX_PARTS:
        parts.append(node.attr)
        node = node.value
    if isinstance(node, ast.Name):
        parts.append(node.id)
    return ".".join(reversed(parts))


def find_root_name(node: ast.AST) -> str:
    """Return the first name of a chain, or "" if it begins with a call or another expression."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def is_doubtful_import(name: str) -> bool:
    """Return whether a dotted imported name reaches a doubtful module through another one.

    Private names of a plain module count as doubtful too: they may run a text or look up any name.
    """
    top, *parts = name.split(".")
    if top in PLAIN_MODULES and any(map(_is_private, parts)):
        return True
    top = top.lstrip("_")
    doubtful = DOUBTFUL_PARTS | (sys.stdlib_module_names - PLAIN_MODULES if top in sys.stdlib_module_names else set())
    return not doubtful.isdisjoint(part.lstrip("_") for part in parts)


def _is_private(name: str) -> bool:
    """Return whether a name begins with an underscore and is not a special name such as ``__name__``."""
    return name.startswith("_") and not (name.startswith("__") and name.endswith("__"))


def read_constant_text(node: ast.AST) -> str | None:
    """Return the result of ``read_constant`` as text, with bytes decoded as Latin-1."""
    source = read_constant(node)
    return source.decode("latin-1") if isinstance(source, bytes) else source


def read_constant(node: ast.AST) -> str | bytes | None:
    """Return the text or bytes of a constant, or of constants joined by ``+`` or in an f-string."""
    match node:
        case ast.Constant(value=str() | bytes() as source):
            return source
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return _join_constants((left, right))
        case ast.JoinedStr(values=values):
            return _join_constants(values)
        case ast.FormattedValue(value=value, conversion=-1, format_spec=None):
            text = read_constant(value)
            return text if isinstance(text, str) else None
    return None


def _join_constants(nodes: Sequence[ast.AST]) -> str | bytes | None:
    sources = [read_constant(node) for node in nodes]
    texts = [source for source in sources if isinstance(source, str)]
    if len(texts) == len(sources):
        return "".join(texts)
    data = [source for source in sources if isinstance(source, bytes)]
    return b"".join(data) if len(data) == len(sources) else None


def evaluate_condition(node: ast.AST) -> bool | None:
    """Return the value of a constant condition, or None if it is only known at run time."""
    match node:
        case ast.Constant(value=value):
            return bool(value)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            operand_value = evaluate_condition(operand)
            return None if operand_value is None else not operand_value
        case ast.BoolOp(op=operator, values=values):
            deciding_value = isinstance(operator, ast.Or)
            known_values = [evaluate_condition(value) for value in values]
            if deciding_value in known_values:
                return deciding_value
            return None if None in known_values else not deciding_value
        case ast.List(elts=[]) | ast.Tuple(elts=[]) | ast.Dict(keys=[]):
            return False
        case ast.Compare(left=ast.Constant(value=left), ops=[operator], comparators=[ast.Constant(value=right)]):
            return _compare_constants(left, operator, right)
    return None


def _compare_constants(left: object, operator: ast.cmpop, right: object) -> bool | None:
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


def is_empty_loop(node: ast.AST) -> bool:
    """Return whether a loop over the node has no iterations."""
    match node:
        case ast.Call(func=ast.Name(id="range"), args=arguments, keywords=[]):
            values = [each.value if isinstance(each, ast.Constant) else None for each in arguments]
            numbers = [value for value in values if isinstance(value, int)]
            return (
                0 < len(numbers) == len(values) <= 3 and (len(numbers) < 3 or numbers[2] != 0) and not range(*numbers)
            )
        case ast.Constant(value=str() | bytes()) | ast.List() | ast.Tuple() | ast.Dict():
            return evaluate_condition(node) is False
    return False


def is_block_end(statement: ast.stmt) -> bool:
    """Return whether the statements after this one in its block are unreachable."""
    match statement:
        case ast.Return() | ast.Raise() | ast.Break() | ast.Continue():
            return True
        case ast.Expr(value=ast.Call(func=function)):
            return find_dotted_name(function) in _EXIT_FUNCTIONS
        case ast.If(test=test, body=body, orelse=orelse):
            branches = {True: (body,), False: (orelse,), None: (body, orelse)}[evaluate_condition(test)]
            return all(any(map(is_block_end, way)) for way in branches)
        case ast.While(test=test):
            return evaluate_condition(test) is True and not any(
                isinstance(each, ast.Break) for each in ast.walk(statement)
            )
    return False


def list_blocks(statement: ast.AST) -> Iterator[tuple[list[ast.stmt], bool]]:
    """Yield the blocks of a compound statement, and whether each is reachable."""
    match statement:
        case ast.If(test=test, body=body, orelse=orelse):
            yield body, evaluate_condition(test) is not False
            yield orelse, evaluate_condition(test) is not True
        case ast.While(test=test, body=body, orelse=orelse):
            yield body, evaluate_condition(test) is not False
            yield orelse, True
        case ast.For(iter=over, body=body, orelse=orelse) | ast.AsyncFor(iter=over, body=body, orelse=orelse):
            yield body, not is_empty_loop(over)
            yield orelse, True
        case _:
            for _, value in ast.iter_fields(statement):
                if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                    yield value, True


def collect_bound_names(body: Sequence[ast.AST]) -> set[str]:
    """Return the names that the code of a scope binds anywhere, without nested functions and classes.

    Unreachable code binds no names.
    """
    names: set[str] = set()
    pending_nodes = list(reversed(body))
    while pending_nodes:
        node = pending_nodes.pop()
        names |= collect_node_bindings(node)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            continue
        if isinstance(node, (ast.Lambda, *_COMPREHENSIONS)):
            names |= {each.target.id for each in ast.walk(node) if isinstance(each, ast.NamedExpr)}
            continue
        dead_statements = {id(statement) for block, live in list_blocks(node) if not live for statement in block}
        pending_nodes += [child for child in ast.iter_child_nodes(node) if id(child) not in dead_statements]
    return names


def collect_node_bindings(node: ast.AST) -> set[str]:
    """Return the names that a single node binds."""
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


def collect_defined_names(tree: ast.Module) -> set[str]:
    """Return the names that a module gives to its own functions, classes and values.

    Excludes names imported under their own name, and instances of classes that it doesn't define.
    """
    nodes = list(ast.walk(tree))
    names = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)}
    for node in nodes:
        match node:
            case ast.Assign(targets=targets, value=value):
                names |= {name for target in targets for name in _collect_assigned_names(target, value, names)}
            case ast.AnnAssign(target=target, value=ast.expr() as value) | ast.NamedExpr(target=target, value=value):
                names |= _collect_assigned_names(target, value, names)
            case ast.For(target=target) | ast.AsyncFor(target=target):
                names |= collect_bound_names([target])
            case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
                names |= {each.asname for each in aliases if each.asname and not _is_last_part(each.name, each.asname)}
    return names


def _collect_assigned_names(target: ast.expr, value: ast.expr, defined_names: Set[str]) -> set[str]:
    match target, value:
        case ((ast.Tuple(elts=targets) | ast.List(elts=targets)), (ast.Tuple(elts=values) | ast.List(elts=values))):
            pairs = zip(targets, values, strict=False)
            return {name for one, other in pairs for name in _collect_assigned_names(one, other, defined_names)}
        case ast.Name(id=name), ast.Call(func=function):
            kind = find_dotted_name(function).rpartition(".")[2]
            is_instance = (
                kind[:1].isupper() and kind not in defined_names and find_root_name(function) not in defined_names
            )
            return set() if is_instance else {name}
        case ast.Name(id=name), ast.Attribute():
            return (
                set()
                if _is_last_part(find_dotted_name(value), name) and find_root_name(value) not in defined_names
                else {name}
            )
    return collect_bound_names([target])


def _is_last_part(dotted_name: str, name: str) -> bool:
    return dotted_name.rpartition(".")[2] == name


def collect_certain_bindings(statement: ast.stmt) -> set[str]:
    """Return the names that have a value after a statement."""
    match statement:
        case ast.Assign(targets=targets):
            return collect_bound_names(targets)
        case ast.AugAssign(target=target) | ast.AnnAssign(target=target, value=ast.expr()):
            return collect_bound_names([target])
    return collect_node_bindings(statement)


def collect_parameters(function: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) -> set[str]:
    """Return the names of all parameters, including starred ones."""
    return {each.arg for each in ast.iter_child_nodes(function.args) if isinstance(each, ast.arg)}


def collect_outer_names(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    """Return the names that a function declares global or nonlocal."""
    name_lists = (node.names for node in ast.walk(function) if isinstance(node, ast.Global | ast.Nonlocal))
    return {name for names in name_lists for name in names}
