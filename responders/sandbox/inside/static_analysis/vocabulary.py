"""The words that a reader of student code looks out for: constructs, and what takes, imports or runs what a text says.

Only the words; what follows from one is in ``walk.py``.
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
#: Calls that look up a text if one of these positional arguments is one, and keywords that do so in every call.
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
#: Calls whose keywords are names of the student's own, and may each be given a text to look up.
NAME_IN_ANY_KEYWORD = frozenset({"agg", "aggregate"})
#: All of these; handed on instead of called, they may take any name.
NAME_TAKERS = TAKES_NAME.keys() | TAKES_NAMES | MAY_TAKE_NAME.keys()
#: Calls that load pickled objects if an argument behind this number of others is true.
MAY_UNPICKLE = {"load": 2, "read_array": 1, "NpzFile": 2}
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
STATES = frozenset({"__getstate__", "__reduce__", "__reduce_ex__", "user_ns"})
TABLES = TABLE_CALLS | STATES | {"__dict__", "__globals__", "__builtins__", "f_globals", "f_locals", "f_builtins"}
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
        # What looks up or works out what a text says, and belongs to a module that is plain but for that.
        *("Formatter", "vformat", "get_type_hints", "ForwardRef", "singledispatch", "singledispatchmethod"),
        *("query", "safe_eval", "bltns", "all_estimators", "all_functions", "get_scorer", "check_scoring"),
        *("__setstate__", *STATES),
    }
)
#: Methods of which the same is true, whatever it is that has them.
DOUBTFUL_METHODS = frozenset({"eval", "exec"})
#: Parts of modules that lead to what is doubtful, whatever they are parts of.
DOUBTFUL_PARTS = frozenset(
    {
        *("builtins", "code", "ctypes", "ctypeslib", "distutils", "externals", "f2py", "gc", "importlib", "inspect"),
        *("os", "pickle", "pydoc", "runpy", "subprocess", "sys", "testing", "types"),
    }
)
#: Modules of which everything that they can do is in the text that uses them. Any other is doubtful.
PLAIN_MODULES = frozenset(
    {
        *("__future__", "abc", "array", "base64", "binascii", "bisect", "calendar", "cmath", "collections"),
        *("colorsys", "contextlib", "copy", "csv", "dataclasses", "datetime", "decimal", "difflib", "enum", "errno"),
        *("fractions", "functools", "hashlib", "heapq", "html", "itertools", "json", "keyword", "math", "numbers"),
        *("operator", "pprint", "queue", "random", "re", "secrets", "statistics", "string", "struct", "textwrap"),
        *("time", "typing", "unicodedata", "uuid", "zlib", "zoneinfo"),
        # The course's.
        *("ev3dev2", "ev3dev2_glue", "nbev3devsim", "nn_tools"),
        *("numpy", "pandas", "PIL", "scipy", "sklearn", "onnxruntime", "ai_edge_litert"),
        # What notebooks show with, for which there are stand-ins.
        *("matplotlib", "seaborn", "IPython", "ipywidgets", "tqdm", "plotly", "pylab", "mpl_toolkits"),
    }
)
