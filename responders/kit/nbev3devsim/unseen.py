"""Stand-ins for what only shows something in a notebook (plots, progress bars, widgets): they take any call.

Nobody sees a graded notebook, and drawing libraries are not within its sandbox.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import sys
import types
from collections.abc import Iterator, Sequence
from typing import Any

from nbev3devsim.tqdma import BARS

_SHOWING = ("matplotlib", "seaborn", "IPython", "ipywidgets", "tqdm", "plotly", "palettable", "pylab", "mpl_toolkits")


class Unseen:
    """Stand-in object: every call, attribute or item returns another one."""

    def __call__(self, *args: Any, **kwargs: Any) -> Unseen:
        return Unseen()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _RETURNS.get(name) or Unseen()

    def __getitem__(self, key: Any) -> Unseen:
        return Unseen()

    def __setitem__(self, key: Any, value: Any) -> None:
        """Ignore the value."""

    def __iter__(self) -> Iterator[Unseen]:
        # As in ``figure, axes = plt.subplots()``.
        return iter((Unseen(), Unseen()))

    def __enter__(self) -> Unseen:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def __repr__(self) -> str:
        return "<not shown>"

    def __float__(self) -> float:
        return 0.0

    def _reckon(self, *_: object) -> Unseen:
        return Unseen()

    # As in ``bar.get_x() + bar.get_width() / 2``.
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = _reckon


def _subplots(nrows: int = 1, ncols: int = 1, *args: Any, squeeze: bool = True, **kwargs: Any) -> tuple[Unseen, Any]:
    """A figure, and as many axes as were asked for."""
    import numpy as np  # here alone: some assignments do without it

    axes = np.empty((nrows, ncols), dtype=object)
    for place in np.ndindex(axes.shape):
        axes[place] = Unseen()
    if not squeeze:
        return Unseen(), axes
    return Unseen(), axes.item() if axes.size == 1 else axes.squeeze()


#: Functions that don't return a single stand-in.
_RETURNS: dict[str, Any] = {
    "subplots": _subplots,
    "plot": lambda *args, **kwargs: [Unseen()],
    "hist": lambda *args, **kwargs: (Unseen(), Unseen(), Unseen()),
}


class _UnseenModule(types.ModuleType):
    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _RETURNS.get(name) or Unseen()


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


def _interact(function: Any = None, *args: Any, **kwargs: Any) -> Any:
    """Return the function that a widget would call, also when used as a decorator."""
    return function if callable(function) else lambda decorated: decorated


def display(*values: Any, **kwargs: Any) -> None:
    """Print the values that a notebook would display."""
    for value in values:
        print(repr(value))


def install(shell: Any) -> None:
    """Let drawing, progress and display modules be imported; ``shell`` is what ``get_ipython()`` gives."""
    known: dict[str, dict[str, Any]] = {
        **{f"tqdm{part}": BARS for part in ("", ".auto", ".autonotebook", ".contrib.concurrent", ".notebook", ".std")},
        "IPython": {"get_ipython": lambda: shell},
        "IPython.display": {"display": display},
        "ipywidgets": {"interact": _interact, "interact_manual": _interact},
    }
    sys.meta_path.insert(0, _Finder(known))
    if "pandas" in sys.modules:
        _hide_pandas_plots_and_styles()


def _hide_pandas_plots_and_styles() -> None:
    import pandas as pd
    import pandas.plotting._core as core

    pd.DataFrame.style = property(lambda _: Unseen())  # type: ignore[assignment]

    backend = types.ModuleType("unseen_plots")
    backend.plot = Unseen()  # type: ignore[attr-defined]
    core._backends["matplotlib"] = backend
