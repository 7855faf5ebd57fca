"""The output formats by name: each registers itself where it is defined, with its suffix and with who reads it.

A format writes a document for one grade, one table for many, or both; nothing here renders.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from rich.console import RenderableType

from service.grading.grade import Grade

_V = TypeVar("_V")


@dataclass(frozen=True, slots=True)
class Format:
    """How grades are written: ``document`` one in a file of its own, ``table`` all of a batch in one.

    ``on_terminal`` is the document for a screen, where it has another shape there.
    """

    name: str
    suffix: str = ""
    document: Callable[[Grade], str] | None = None
    table: Callable[[Sequence[Grade]], str] | None = None
    on_terminal: Callable[[Grade], RenderableType] | None = None


FORMATS: dict[str, Format] = {}


def document(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[Callable[[_V], str]], Callable[[_V], str]]:
    """Registers a function that writes what ``view`` leaves of one grade."""

    def register(render: Callable[[_V], str]) -> Callable[[_V], str]:
        FORMATS[name] = replace(_begun(name), suffix=suffix, document=lambda grade: render(view(grade)))
        return render

    return register


def table(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[Callable[[Sequence[_V]], str]], Callable[[Sequence[_V]], str]]:
    """Registers a function that writes what ``view`` leaves of the grades of a batch."""

    def register(render: Callable[[Sequence[_V]], str]) -> Callable[[Sequence[_V]], str]:
        FORMATS[name] = replace(
            _begun(name), suffix=suffix, table=lambda grades: render([view(grade) for grade in grades])
        )
        return render

    return register


def on_terminal(
    name: str, view: Callable[[Grade], _V]
) -> Callable[[Callable[[_V], RenderableType]], Callable[[_V], RenderableType]]:
    """Registers a function that shows on a screen what ``view`` leaves of one grade."""

    def register(render: Callable[[_V], RenderableType]) -> Callable[[_V], RenderableType]:
        FORMATS[name] = replace(_begun(name), on_terminal=lambda grade: render(view(grade)))
        return render

    return register


def _begun(name: str) -> Format:
    return FORMATS.get(name, Format(name))
