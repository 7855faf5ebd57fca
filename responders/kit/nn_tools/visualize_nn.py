"""Placeholders for drawings of networks. Every function accepts any call and draws nothing."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return lambda *_args, **_kwargs: None
