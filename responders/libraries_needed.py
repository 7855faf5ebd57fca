"""Whether a responder may need libraries, read from the syntax trees of all that it can run.

Only one that surely needs none is said to need none: such a one is the same where libraries are loaded and where they
are not. What it imports in spite of that is noticed by ``sandbox/inside/libraries.py``, when it does.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator, Mapping
from itertools import chain

from responders.sandbox.inside.libraries import BESIDE
from sim.readers.python_source import parse_module
from sim.readers.unreadable import Unreadable

_LOADED = ("nbev3devsim.load_nbev3devwidget", "inside.static_analysis.reader")
#: Characters of one text; reading a longer one takes long.
_MOST_READ = 60_000
#: Names by which a program can come to what is loaded, or to code that no tree shows, or by which it sees when memory
#: is given back; and what of the course's needs libraries.
_LEADING_AWAY = re.compile(
    r"modules|meta_path|path_hooks|path_importer_cache|settrace|setprofile|eval|exec|compile|getattr|globals|locals"
    r"|vars|dir|help|breakpoint|attrgetter|methodcaller|get_type_hints|ForwardRef|Formatter|make_dataclass|image_data"
    r"|builtins|importlib|(?:gi|cr|ag|tb)_frame|f_(?:back|builtins|globals|locals)"
    r"|_getframe|_current_frames|__(?!(?:name|main|init|str|repr|doc|class|len|call)__$)\w+"
)
_WORD = re.compile(r"\w+")
#: In a notebook: what starts a robot, whose program is run elsewhere, and what does nothing here.
_ROBOT_CELL = re.compile(r"\s*%%sim_magic")
_HARMLESS_LINE = re.compile(r"^[ \t]*%(?:sim_magic|(?:re)?load_ext |matplotlib |config )[^{$\n]*$", re.MULTILINE)


def may_need_libraries(text: str, files: Mapping[str, bytes]) -> bool:
    """Of a module, with the files in its folder."""
    modules = {name.removesuffix(".py"): data for name, data in files.items() if name.endswith(".py")}
    # One called like a part of a library could not be imported beside it.
    if any(name.startswith(("_", "cython")) for name in modules):
        return True
    try:
        texts = (text, *(data.decode() for data in modules.values()))
    except UnicodeDecodeError:
        return True
    known = {*modules, *BESIDE, *_LOADED}
    return any((imported := _imports(each)) is None or not known.issuperset(imported) for each in texts)


def notebook_source(cells: tuple[str, ...]) -> str:
    """What of a notebook is run as Python in its own process; most magics stay in it, and are no Python."""
    return "\n".join(_HARMLESS_LINE.sub("pass", cell) for cell in cells if not _ROBOT_CELL.match(cell))


@functools.lru_cache(maxsize=64)
def _imports(text: str) -> frozenset[str] | None:
    """Return all that a text imports; None where that cannot be known. Parses a text once, whoever has it."""
    if len(text) > _MOST_READ:
        return None
    try:
        nodes = list(ast.walk(parse_module(text)))
    except (SyntaxError, Unreadable):
        # The error may be all there is to it, but then it costs little.
        return None
    if any(map(_LEADING_AWAY.fullmatch, chain.from_iterable(map(_named, nodes)))):
        return None
    return frozenset(chain.from_iterable(map(_imported, nodes)))


def _imported(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (each.name for each in node.names)
    elif isinstance(node, ast.ImportFrom):
        yield "." * node.level + (node.module or "")


def _named(node: ast.AST) -> Iterator[str]:
    match node:
        case ast.Attribute(value=ast.Name(id="re"), attr="compile"):
            pass
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.alias(name=name):
            yield name
        case ast.FunctionDef(name="__del__" as name) | ast.AsyncFunctionDef(name="__del__" as name):
            yield name
        case ast.MatchClass(kwd_attrs=names):
            yield from names
        case ast.Constant(value=str(text)) if "{" in text:
            # What a format reaches of its values.
            yield from _WORD.findall(text)
