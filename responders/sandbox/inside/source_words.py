"""The words that a reader of student code looks out for: constructs, and what takes, imports or runs what a text says.

Only the words; what follows from one is in ``source_walk.py``.
"""

from __future__ import annotations

import ast

CONSTRUCTS: dict[type[ast.AST], str] = {
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

#: Calls that take what a text names, and which of their arguments that is.
TAKES_NAME = {"getattr": 1, "__getattribute__": -1, "__getattr__": -1}
#: Those all of whose arguments are names.
TAKES_NAMES = frozenset({"attrgetter", "methodcaller", "itemgetter"})
#: Calls that import what a text names.
IMPORTERS = frozenset(
    {
        *("__import__", "import_module", "resolve_name", "locate", "safeimport", "run_module", "find_spec"),
        *("find_module", "find_loader", "get_loader", "load_module", "PyImport_ImportModule", "PyImport_Import"),
        *("PyImport_ImportModuleNoBlock", "PyImport_ImportModuleLevel", "PyImport_AddModule", "PyImport_GetModule"),
    }
)
#: Tables that hold things by their names, the calls that give one, and how they are asked.
TABLE_CALLS = frozenset({"globals", "locals", "vars"})
TABLES = TABLE_CALLS | {"__dict__", "__globals__", "__builtins__", "f_globals", "f_locals", "f_builtins"}
GETTERS = frozenset({"get", "pop", "setdefault", "__getitem__"})
#: Calls that run a text, and those that hand one to a notebook's magics.
RUNNERS = frozenset({"exec", "eval", "compile"})
MAGICS = frozenset({"run_line_magic", "run_cell_magic", "magic"})

#: What can do more than its text shows: names that stand alone, names anywhere, and modules.
DOUBTFUL_ALONE = RUNNERS | TABLE_CALLS | {"dir", "breakpoint"}
DOUBTFUL = frozenset(
    {
        *("__import__", "__builtins__", "__loader__", "__spec__", "__subclasses__", "__mro__", "__bases__", "__base__"),
        *("__globals__", "__code__", "__closure__", "__dict__", "__getattribute__", "f_globals", "f_locals", "f_back"),
        *("f_builtins", "_getframe", "tb_frame", "gi_frame", "settrace", "setprofile", "meta_path", "path_hooks"),
        *("get_objects", "get_referrers", "get_referents", "read_pickle", "run_line_magic", "run_cell_magic"),
    }
)
DOUBTFUL_MODULES = frozenset(
    {
        *("importlib", "runpy", "pkgutil", "zipimport", "imp", "_imp", "_frozen_importlib", "pydoc", "ctypes"),
        *("_ctypes", "cffi", "marshal", "gc", "inspect", "code", "codeop", "builtins", "pickle", "_pickle"),
        *("joblib", "dill", "cloudpickle", "shelve", "brick_link"),
    }
)
