"""The registry of output formats. Each format registers itself, with its suffix and its view of a grade.

A format writes a document for one grade, one table for many, or both. This module renders nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, BinaryIO, Protocol, TypeVar

from rich.console import RenderableType

from service.grading.grade import Grade
from service.reports.rows import ReportPage, TableRow
from submissions.submission import Submission

_V = TypeVar("_V")
_Writes = TypeVar("_Writes", bound=Callable[..., str])
_Shows = TypeVar("_Shows", bound=Callable[..., RenderableType])
_T = TypeVar("_T", covariant=True)


class OfOne(Protocol[_T]):
    """Renders one grade, with source lines if the submission is given."""

    def __call__(self, grade: Grade, submission: Submission | None = None, /) -> _T:
        """Render the grade. Without the submission there is no excerpt."""


@dataclass(frozen=True, slots=True)
class FilledIn:
    """A table from another system with the grades filled in, and the rows that did not fit."""

    text: str
    left_over: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Format:
    """An output format: ``document`` writes one grade to a file, ``table`` all grades of a batch to one file.

    ``refusal`` is the document of a rejected submission. ``on_terminal`` is the document for a terminal, if it differs.
    ``filled_in`` fills in a given table. ``packed`` packs reports into a file.
    """

    name: str
    suffix: str = ""
    document: OfOne[str] | None = None
    refusal: Callable[[TableRow[Grade]], str] | None = None
    table: Callable[[Sequence[TableRow[Grade]]], str] | None = None
    on_terminal: OfOne[RenderableType] | None = None
    filled_in: Callable[[Sequence[TableRow[Grade]], str], FilledIn] | None = None
    packed: Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]] | None = None


FORMATS: dict[str, Format] = {}


def document(name: str, suffix: str, view: Callable[[Grade], Any]) -> Callable[[_Writes], _Writes]:
    """Register a function that writes one grade, as seen through ``view``, with the submission if it is given."""

    def register(render: _Writes) -> _Writes:
        def written(grade: Grade, submission: Submission | None = None, /) -> str:
            return render(view(grade), submission)

        FORMATS[name] = replace(_begun(name), suffix=suffix, document=written)
        return render

    return register


def refusal(name: str) -> Callable[[Callable[[TableRow[Grade]], str]], Callable[[TableRow[Grade]], str]]:
    """Register a function that writes the document of a rejected row."""

    def register(render: Callable[[TableRow[Grade]], str]) -> Callable[[TableRow[Grade]], str]:
        FORMATS[name] = replace(_begun(name), refusal=render)
        return render

    return register


def table(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[Callable[[Sequence[TableRow[_V]]], str]], Callable[[Sequence[TableRow[_V]]], str]]:
    """Register a function that writes the rows of a batch, with their grades as seen through ``view``."""

    def register(render: Callable[[Sequence[TableRow[_V]]], str]) -> Callable[[Sequence[TableRow[_V]]], str]:
        FORMATS[name] = replace(
            _begun(name), suffix=suffix, table=lambda rows: render([row.shown(view) for row in rows])
        )
        return render

    return register


def filled_in(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[Callable[[Sequence[TableRow[_V]], str], FilledIn]], Callable[[Sequence[TableRow[_V]], str], FilledIn]]:
    """Register a function that fills the rows of a batch into another system's table."""

    def register(
        render: Callable[[Sequence[TableRow[_V]], str], FilledIn],
    ) -> Callable[[Sequence[TableRow[_V]], str], FilledIn]:
        FORMATS[name] = replace(
            _begun(name),
            suffix=suffix,
            filled_in=lambda rows, given: render([row.shown(view) for row in rows], given),
        )
        return render

    return register


def packed(
    name: str, suffix: str
) -> Callable[
    [Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]]],
    Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]],
]:
    """Register a function that packs the reports of a batch into a file and returns the students left out."""

    def register(
        pack: Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]],
    ) -> Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]]:
        FORMATS[name] = replace(_begun(name), suffix=suffix, packed=pack)
        return pack

    return register


def on_terminal(name: str, view: Callable[[Grade], Any]) -> Callable[[_Shows], _Shows]:
    """Register a function that shows one grade, as seen through ``view``, in a terminal."""

    def register(render: _Shows) -> _Shows:
        def shown(grade: Grade, submission: Submission | None = None, /) -> RenderableType:
            return render(view(grade), submission)

        FORMATS[name] = replace(_begun(name), on_terminal=shown)
        return render

    return register


def _begun(name: str) -> Format:
    return FORMATS.get(name, Format(name))
