"""Stand-ins for what only shows something in a notebook (plots, progress bars, widgets): they take any call.

Nobody sees a graded notebook, and drawing libraries are not within its sandbox.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import sys
import types
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

_SHOWING = ("matplotlib", "seaborn", "IPython", "ipywidgets", "tqdm", "plotly", "palettable", "pylab", "mpl_toolkits")


class Unseen:
    """Whatever is asked of it, it gives another of its kind."""

    def __call__(self, *args: Any, **kwargs: Any) -> Unseen:
        return Unseen()

    def __getattr__(self, name: str) -> Unseen:
        if name.startswith("__"):
            raise AttributeError(name)
        return Unseen()

    def __getitem__(self, key: Any) -> Unseen:
        return Unseen()

    def __setitem__(self, key: Any, value: Any) -> None:
        """Forgotten."""

    def __iter__(self) -> Iterator[Unseen]:
        # As in ``figure, axes = plt.subplots()``.
        return iter((Unseen(), Unseen()))

    def __enter__(self) -> Unseen:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def __repr__(self) -> str:
        return "<not shown>"


class _UnseenModule(types.ModuleType):
    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Unseen()


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, known: dict[str, dict[str, Any]]) -> None:
        self._known = known

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname.partition(".")[0] not in _SHOWING:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        return _UnseenModule(spec.name)

    def exec_module(self, module: types.ModuleType) -> None:
        module.__dict__.update(self._known.get(module.__name__, {}))


def _each(iterable: Iterable[Any] = (), *args: Any, **kwargs: Any) -> Iterable[Any]:
    return iterable


def _counted(*args: int, **kwargs: Any) -> range:
    return range(*args)


def display(*values: Any, **kwargs: Any) -> None:
    """What a notebook shows becomes what it prints."""
    for value in values:
        print(repr(value))


def install(shell: Any) -> None:
    """Let drawing, progress and display modules be imported; ``shell`` is what ``get_ipython()`` gives."""
    bars = {"tqdm": _each, "trange": _counted, "tqdm_notebook": _each, "tnrange": _counted}
    known: dict[str, dict[str, Any]] = {
        "tqdm": bars,
        "tqdm.notebook": bars,
        "tqdm.auto": bars,
        "IPython": {"get_ipython": lambda: shell},
        "IPython.display": {"display": display},
        "matplotlib.pyplot": {"hist": lambda *args, **kwargs: (Unseen(), Unseen(), Unseen())},
    }
    sys.meta_path.insert(0, _Finder(known))
    if "pandas" in sys.modules:
        _hide_pandas_plots()


def _hide_pandas_plots() -> None:
    import pandas.plotting._core as core

    backend = types.ModuleType("unseen_plots")
    backend.plot = Unseen()  # type: ignore[attr-defined]
    core._backends["matplotlib"] = backend
