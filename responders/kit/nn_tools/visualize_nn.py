"""Stand-in for the drawings of networks: every function exists, takes any call and draws nothing."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return lambda *_args, **_kwargs: None
