"""What stands in a Python file, found in its syntax tree: runs inside the walls, because a parser can be made to crash.

It imports nothing of ours, runs nothing of what it reads, and judges nothing.
"""

import ast
import json

_CONSTRUCTS = {
    ast.For: "for",
    ast.AsyncFor: "for",
    ast.While: "while",
    ast.If: "if",
    ast.IfExp: "if",
    ast.Break: "break",
    ast.Continue: "continue",
    ast.FunctionDef: "def",
    ast.AsyncFunctionDef: "def",
    ast.Return: "return",
    ast.ClassDef: "class",
    ast.Lambda: "lambda",
    ast.Try: "try",
    ast.TryStar: "try",
    ast.With: "with",
    ast.AsyncWith: "with",
    ast.Global: "global",
    ast.List: "list",
    ast.Dict: "dict",
    ast.ListComp: "comprehension",
    ast.SetComp: "comprehension",
    ast.DictComp: "comprehension",
    ast.GeneratorExp: "comprehension",
}
_KINDS = ("constructs", "calls", "looped", "handed_on", "names", "functions", "imports")
_LOOPS = (ast.For, ast.AsyncFor, ast.While, ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
#: Calls that take what a text names, that import it, and tables that hold everything by its name.
_BY_NAME = ("getattr", "attrgetter", "methodcaller")
_IMPORTERS = ("__import__", "import_module")
_TABLES = ("globals", "locals", "vars", "__dict__", "modules", "__builtins__")
_LONGEST_TEXT = 300_000
_MOST = 400
_LONGEST = 60
_MOST_TOLD = 50_000


def facts(text):
    """Constructs, calls, names, functions and imports, each with the first line it stands in; or the error.

    ``handed_on`` are functions that are not called where they stand but given another name, or away.
    """
    if len(text) > _LONGEST_TEXT:
        return {"error": {"text": f"it has more than {_LONGEST_TEXT} characters", "line": None}}
    try:
        tree = ast.parse(text)
    except SyntaxError as error:
        return {"error": {"text": str(error.msg)[:200], "line": error.lineno}}
    except ValueError:
        return {"error": {"text": "it has characters that no Python file has", "line": None}}
    except (RecursionError, MemoryError):
        return {"error": {"text": "it is nested too deeply", "line": None}}
    found = {kind: {} for kind in _KINDS}
    own = _own_names(tree)
    waiting = [(tree, False)]
    while waiting:
        node, in_loop = waiting.pop()
        _note(node, in_loop, found)
        below = in_loop or isinstance(node, _LOOPS)
        for child in reversed(list(ast.iter_child_nodes(node))):
            if not (isinstance(node, ast.Call) and child is node.func):
                _note_handed_on(child, own, found)
            waiting.append((child, below))
    told = _fitted({kind: _by_line(lines) for kind, lines in found.items()})
    return {"error": None, "cut": any(len(told[kind]) < len(found[kind]) for kind in found), **told}


def _note(node, in_loop, found):
    line = getattr(node, "lineno", 0)
    kind = _CONSTRUCTS.get(type(node))
    if kind:
        _add(found["constructs"], kind, line)
    if isinstance(node, (ast.If, ast.For, ast.While)) and node.orelse:
        _add(found["constructs"], "else", line)
    if isinstance(node, ast.Call):
        name = _dotted(node.func)
        _add(found["calls"], name, line)
        if in_loop:
            _add(found["looped"], name, line)
        _note_by_text(name, node.args, line, found)
    elif isinstance(node, ast.Subscript):
        table = _dotted(node.value.func if isinstance(node.value, ast.Call) else node.value)
        if table.endswith(_TABLES):
            _add(found["imports" if table.endswith("modules") else "handed_on"], _text(node.slice), line)
    elif isinstance(node, (ast.Name, ast.Attribute)):
        _add(found["names"], _dotted(node), line)
    elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        _add(found["functions"], node.name, line)
    elif isinstance(node, ast.Import):
        for alias in node.names:
            _add(found["imports"], alias.name[:_LONGEST], line)
    elif isinstance(node, ast.ImportFrom):
        _add(found["imports"], (node.module or "")[:_LONGEST], line)
        for alias in node.names:
            _add(found["names"], alias.name, line)
            if alias.asname not in (None, alias.name):
                _add(found["handed_on"], alias.name, line)


def _note_handed_on(node, own, found):
    """A function that is not called here but kept or given away, so that it can be called by another name."""
    named = isinstance(node, ast.Attribute) or (isinstance(node, ast.Name) and node.id not in own)
    if named and isinstance(node.ctx, ast.Load):
        _add(found["handed_on"], _dotted(node), node.lineno)


def _note_by_text(name, arguments, line, found):
    """What a call asks for by a text that stands there: ``getattr(robot, "say")``, ``import_module("sklearn")``."""
    last = name.rpartition(".")[2]
    if last in _IMPORTERS and arguments:
        _add(found["imports"], _text(arguments[0])[:_LONGEST], line)
    if last in _BY_NAME:
        for argument in arguments:
            _add(found["handed_on"], _text(argument), line)
            _add(found["names"], _text(argument), line)


def _own_names(tree):
    """Names that the text itself gives to something, as ``sum = 0`` does: to mention those takes no function."""
    own = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
            own.add(node.id)
        elif isinstance(node, ast.arg):
            own.add(node.arg)
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            own.add(node.name)
    return own


def _text(node):
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def _by_line(lines):
    return sorted(lines.items(), key=lambda item: item[1])


def _fitted(found):
    """As much from the beginning of the file as the wire carries."""
    for lines in found.values():
        del lines[_MOST:]
    while len(json.dumps(found)) > _MOST_TOLD:
        longest = max(found, key=lambda kind: len(found[kind]))
        del found[longest][len(found[longest]) // 2 :]
    return found


def _add(lines, name, line):
    """The end of a long name is kept: there stands what is called."""
    if name:
        lines[name[-_LONGEST:]] = min(line, lines.get(name[-_LONGEST:], line))


def _dotted(node):
    """``tank_drive.on`` for a chain of names; the names behind the last call or index of any other chain."""
    parts = []
    while isinstance(node, ast.Attribute) and len(parts) < 10:
        parts.append(node.attr)
        node = node.value
    if isinstance(node, ast.Name):
        parts.append(node.id)
    return ".".join(reversed(parts))
