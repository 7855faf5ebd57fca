"""Silent progress bars with the interface that notebooks use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any


class tqdm:
    """A progress bar that is not shown."""

    def __init__(self, iterable: Any = None, desc: str | None = None, total: float | None = None, **_: Any) -> None:
        self._iterable = () if iterable is None else iterable
        self.desc = desc
        self.total = len(iterable) if total is None and hasattr(iterable, "__len__") else total
        self.n: float = 0

    def __iter__(self) -> Iterator[Any]:
        for item in self._iterable:
            yield item
            self.n += 1

    def __len__(self) -> int:
        return int(self.total or 0)

    def __bool__(self) -> bool:
        return self.total is None or self.total > 0

    def __enter__(self) -> tqdm:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def update(self, n: float = 1) -> None:
        """Advance the count by ``n``."""
        self.n += n

    def reset(self, total: float | None = None) -> None:
        """Reset the count."""
        self.n = 0
        self.total = self.total if total is None else total

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_args, **_kwargs: None

    @staticmethod
    def write(s: str, *_: Any, **__: Any) -> None:
        print(s)

    @classmethod
    def pandas(cls, *_: Any, **__: Any) -> None:
        """Add ``progress_apply`` and ``progress_map`` to tables and columns."""
        import pandas as pd

        for kind in (pd.DataFrame, pd.Series):
            kind.progress_apply = kind.apply
            kind.progress_map = kind.map


def trange(*args: int, **kwargs: Any) -> tqdm:
    return tqdm(range(*args), **kwargs)


def _map_items(function: Any, *iterables: Iterable[Any], **_: Any) -> list[Any]:
    return list(map(function, *iterables))


tqdm_notebook = tqdma = tqdm
#: Names of tqdm's modules that notebooks import.
BARS = {
    **dict.fromkeys(("tqdm", "tqdm_notebook"), tqdm),
    **dict.fromkeys(("trange", "tnrange"), trange),
    **dict.fromkeys(("process_map", "thread_map"), _map_items),
}
