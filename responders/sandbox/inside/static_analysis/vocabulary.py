"""Names with a meaning for the analysis: constructs, and functions that look up, import or run a text.

``syntax_walker.py`` applies them.
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

#: Calls that look up a name, and the position of that argument.
TAKES_NAME = {"getattr": 1, "__getattribute__": -1, "__getattr__": -1}
#: Calls whose arguments are all names to look up.
TAKES_NAMES = frozenset({"attrgetter", "methodcaller", "itemgetter"})
#: Calls that look up a text in these positional arguments, then keywords that do so in every call.
MAY_TAKE_NAME: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(("agg", "aggregate", "apply"), (0,)),
    "NamedAgg": (1,),
    "pivot_table": (3, 4),  # of a table, and of pandas
    "crosstab": (5,),
    "wraps": (1, 2),
    "update_wrapper": (2, 3),
}
NAME_KEYWORDS = frozenset(
    {"func", "aggfunc", "method", "stack_method", "response_method", "importance_getter", "assigned", "updated"}
)
#: Calls whose keyword names are the student's own and whose values may be texts to look up.
NAME_IN_ANY_KEYWORD = frozenset({"agg", "aggregate"})
#: All of these. If passed on instead of called, they may look up any name.
NAME_TAKERS = TAKES_NAME.keys() | TAKES_NAMES | MAY_TAKE_NAME.keys()
#: Calls that load pickled objects if an argument after this number of others is true.
MAY_UNPICKLE = {"load": 2, "read_array": 1, "NpzFile": 2}
#: Calls that import a module given as text.
IMPORTERS = frozenset(
    {
        *("__import__", "import_module", "resolve_name", "locate", "safeimport", "run_module", "find_spec"),
        *("find_module", "find_loader", "get_loader", "load_module", "PyImport_ImportModule", "PyImport_Import"),
        *("PyImport_ImportModuleNoBlock", "PyImport_ImportModuleLevel", "PyImport_AddModule", "PyImport_GetModule"),
    }
)
#: Tables of objects by name, the calls that return one, and the methods for access.
TABLE_CALLS = frozenset({"globals", "locals", "vars"})
STATES = frozenset({"__getstate__", "__reduce__", "__reduce_ex__", "user_ns"})
TABLES = TABLE_CALLS | STATES | {"__dict__", "__globals__", "__builtins__", "f_globals", "f_locals", "f_builtins"}
GETTERS = frozenset({"get", "pop", "setdefault", "__getitem__"})
#: Calls that run a text, and those that pass one to a notebook's magics.
RUNNERS = frozenset({"exec", "eval", "compile"})
MAGICS = frozenset({"run_line_magic", "run_cell_magic", "magic"})

#: Names and modules whose effects the text doesn't show: stand-alone names, names anywhere, modules.
DOUBTFUL_ALONE = RUNNERS | TABLE_CALLS | {"dir", "breakpoint"}
DOUBTFUL = frozenset(
    {
        *("__import__", "__builtins__", "__loader__", "__spec__", "__subclasses__", "__mro__", "__bases__", "__base__"),
        *("__globals__", "__code__", "__closure__", "__dict__", "__getattribute__", "f_globals", "f_locals", "f_back"),
        *("f_builtins", "_getframe", "tb_frame", "gi_frame", "settrace", "setprofile", "meta_path", "path_hooks"),
        *("get_objects", "get_referrers", "get_referents", "read_pickle", "run_line_magic", "run_cell_magic"),
        # Names in otherwise plain modules that look up or evaluate a text.
        *("Formatter", "vformat", "get_type_hints", "ForwardRef", "singledispatch", "singledispatchmethod"),
        *("query", "safe_eval", "bltns", "all_estimators", "all_functions", "get_scorer", "check_scoring"),
        *("__setstate__", *STATES),
    }
)
#: Methods for which the same is true, on any object.
DOUBTFUL_METHODS = frozenset({"eval", "exec"})
#: Parts of any module that give access to doubtful code.
DOUBTFUL_PARTS = frozenset(
    {
        *("builtins", "code", "ctypes", "ctypeslib", "distutils", "externals", "f2py", "gc", "importlib", "inspect"),
        *("os", "pickle", "pydoc", "runpy", "subprocess", "sys", "testing", "types"),
    }
)
#: Modules without hidden effects: the text that uses them shows all that they do. All others are doubtful.
PLAIN_MODULES = frozenset(
    {
        *("__future__", "abc", "array", "base64", "binascii", "bisect", "calendar", "cmath", "collections"),
        *("colorsys", "contextlib", "copy", "csv", "dataclasses", "datetime", "decimal", "difflib", "enum", "errno"),
        *("fractions", "functools", "hashlib", "heapq", "html", "itertools", "json", "keyword", "math", "numbers"),
        *("operator", "pprint", "queue", "random", "re", "secrets", "statistics", "string", "struct", "textwrap"),
        *("time", "typing", "unicodedata", "uuid", "zlib", "zoneinfo"),
        # Modules of the course.
        *("ev3dev2", "ev3dev2_glue", "nbev3devsim", "nn_tools"),
        *("numpy", "pandas", "PIL", "scipy", "sklearn", "onnxruntime", "ai_edge_litert"),
        # Display modules of notebooks, which have stand-ins.
        *("matplotlib", "seaborn", "IPython", "ipywidgets", "tqdm", "plotly", "pylab", "mpl_toolkits"),
    }
)
