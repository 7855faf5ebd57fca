"""Placeholders for modules that only show something in a notebook: plots, progress bars, widgets.

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

_DISPLAY_LIBRARIES = (
    "matplotlib",
    "seaborn",
    "IPython",
    "ipywidgets",
    "tqdm",
    "plotly",
    "palettable",
    "pylab",
    "mpl_toolkits",
)


class Placeholder:
    """Placeholder object: every call, attribute or item returns another placeholder."""

    def __call__(self, *args: Any, **kwargs: Any) -> Placeholder:
        return Placeholder()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _RETURNS.get(name) or Placeholder()

    def __getitem__(self, key: Any) -> Placeholder:
        return Placeholder()

    def __setitem__(self, key: Any, value: Any) -> None:
        """Ignore the value."""

    def __iter__(self) -> Iterator[Placeholder]:
        # As in ``figure, axes = plt.subplots()``.
        return iter((Placeholder(), Placeholder()))

    def __enter__(self) -> Placeholder:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def __repr__(self) -> str:
        return "<not shown>"

    def __float__(self) -> float:
        return 0.0

    def _reckon(self, *_: object) -> Placeholder:
        return Placeholder()

    # As in ``bar.get_x() + bar.get_width() / 2``.
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = _reckon


def _build_subplots(
    nrows: int = 1, ncols: int = 1, *args: Any, squeeze: bool = True, **kwargs: Any
) -> tuple[Placeholder, Any]:
    """Return a figure and the requested number of axes."""
    import numpy as np  # here alone: some assignments do without it

    axes = np.empty((nrows, ncols), dtype=object)
    for place in np.ndindex(axes.shape):
        axes[place] = Placeholder()
    if not squeeze:
        return Placeholder(), axes
    return Placeholder(), axes.item() if axes.size == 1 else axes.squeeze()


#: Functions that don't return a single stand-in.
_RETURNS: dict[str, Any] = {
    "subplots": _build_subplots,
    "plot": lambda *args, **kwargs: [Placeholder()],
    "hist": lambda *args, **kwargs: (Placeholder(), Placeholder(), Placeholder()),
}


class _PlaceholderModule(types.ModuleType):
    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _RETURNS.get(name) or Placeholder()


class _PlaceholderFinder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, known: dict[str, dict[str, Any]]) -> None:
        self._known = known

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname.partition(".")[0] not in _DISPLAY_LIBRARIES:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        return _PlaceholderModule(spec.name)

    def exec_module(self, module: types.ModuleType) -> None:
        module.__dict__.update(self._known.get(module.__name__, {}))


def _select_function(function: Any = None, *args: Any, **kwargs: Any) -> Any:
    """Return the function that a widget would call, also when used as a decorator."""
    return function if callable(function) else lambda decorated: decorated


def display(*values: Any, **kwargs: Any) -> None:
    """Print the values that a notebook would display."""
    for value in values:
        print(repr(value))


def install_placeholders(shell: Any) -> None:
    """Make drawing, progress and display modules importable. ``get_ipython()`` returns ``shell``."""
    known: dict[str, dict[str, Any]] = {
        **{f"tqdm{part}": BARS for part in ("", ".auto", ".autonotebook", ".contrib.concurrent", ".notebook", ".std")},
        "IPython": {"get_ipython": lambda: shell},
        "IPython.display": {"display": display},
        "ipywidgets": {"interact": _select_function, "interact_manual": _select_function},
    }
    sys.meta_path.insert(0, _PlaceholderFinder(known))
    if "pandas" in sys.modules:
        _hide_pandas_plots_and_styles()


def _hide_pandas_plots_and_styles() -> None:
    import pandas as pd
    import pandas.plotting._core as core

    pd.DataFrame.style = property(lambda _: Placeholder())  # type: ignore[assignment]

    backend = types.ModuleType("unseen_plots")
    backend.plot = Placeholder()  # type: ignore[attr-defined]
    core._backends["matplotlib"] = backend
