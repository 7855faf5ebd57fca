"""Detection of responders that need no scientific libraries, from the syntax trees of all code they can run.

The answer is False only if certain, so that the responder behaves the same with and without loaded libraries.
``sandbox/inside/libraries.py`` detects imports that were missed, at run time.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator, Mapping
from itertools import chain

from responders.sandbox.inside.libraries import STANDARD_MODULES
from sim.readers.python_source import parse_module
from sim.readers.reader_errors import UnreadableDataError

_LOADED_MODULES = ("nbev3devsim.load_nbev3devwidget", "inside.static_analysis.reader")
#: Maximum number of characters of a module and those beside it, because parsing longer texts is slow.
_MAX_CHARACTERS = 60_000
#: Names that give access to loaded modules, to code outside the syntax trees, or to garbage collection; and course
#: modules that need libraries.
_UNSAFE_NAMES = re.compile(
    r"modules|meta_path|path_hooks|path_importer_cache|settrace|setprofile|eval|exec|compile|getattr|globals|locals"
    r"|vars|dir|help|breakpoint|attrgetter|methodcaller|get_type_hints|ForwardRef|Formatter|make_dataclass|image_data"
    r"|builtins|importlib|(?:gi|cr|ag|tb)_frame|f_(?:back|builtins|globals|locals)"
    r"|_getframe|_current_frames|__(?!(?:name|main|init|str|repr|doc|class|len|call)__$)\w+"
)
_WORD = re.compile(r"\w+")
#: Notebook magics that start a robot program, which runs in another process, or that do nothing here.
_ROBOT_CELL = re.compile(r"\s*%%sim_magic")
_HARMLESS_LINE = re.compile(r"^[ \t]*%(?:sim_magic|(?:re)?load_ext |matplotlib |config )[^{$\n]*$", re.MULTILINE)


def may_need_libraries(text: str, files: Mapping[str, bytes]) -> bool:
    """Return whether a module with these files in its folder may need libraries."""
    modules = {name.removesuffix(".py"): data for name, data in files.items() if name.endswith(".py")}
    # A module with the name of a library part would hide it on import.
    if any(name.startswith(("_", "cython")) for name in modules):
        return True
    try:
        texts = (text, *(data.decode() for data in modules.values()))
    except UnicodeDecodeError:
        return True
    return _may_import_libraries(texts, frozenset((*modules, *STANDARD_MODULES, *_LOADED_MODULES)))


@functools.lru_cache(maxsize=64)
def _may_import_libraries(texts: tuple[str, ...], known_modules: frozenset[str]) -> bool:
    """Return whether the modules may import others than the known ones. Parses each submission once for all trials."""
    if sum(map(len, texts)) > _MAX_CHARACTERS:
        return True
    return any(
        (imported_names := _find_imports(each)) is None or not known_modules.issuperset(imported_names)
        for each in texts
    )


def build_notebook_source(cells: tuple[str, ...]) -> str:
    """Return a notebook's source that runs as Python in its own process. Most magics remain and don't parse."""
    return "\n".join(_HARMLESS_LINE.sub("pass", cell) for cell in cells if not _ROBOT_CELL.match(cell))


def _find_imports(text: str) -> frozenset[str] | None:
    """Return all names that a text imports, or None if that is unknown."""
    try:
        nodes = list(ast.walk(parse_module(text)))
    except (SyntaxError, UnreadableDataError):
        # The program may only report this error; loading libraries for it costs little.
        return None
    if any(map(_UNSAFE_NAMES.fullmatch, chain.from_iterable(map(_list_mentioned_names, nodes)))):
        return None
    return frozenset(chain.from_iterable(map(_list_imported_modules, nodes)))


def _list_imported_modules(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (each.name for each in node.names)
    elif isinstance(node, ast.ImportFrom):
        yield "." * node.level + (node.module or "")


def _list_mentioned_names(node: ast.AST) -> Iterator[str]:
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
            # Format strings can access attributes of their values.
            yield from _WORD.findall(text)
