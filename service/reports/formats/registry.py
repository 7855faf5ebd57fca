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


class GradeRenderer(Protocol[_T]):
    """Renders one grade, with source lines if the submission is given."""

    def __call__(self, grade: Grade, submission: Submission | None = None, /) -> _T:
        """Render the grade. Without the submission there is no excerpt."""


@dataclass(frozen=True, slots=True)
class FilledWorksheet:
    """A table from another system with the grades filled in, and the rows that did not fit."""

    text: str
    left_over: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Format:
    """An output format: ``document`` writes one grade to a file, ``table`` all grades of a batch to one file.

    ``refusal`` is the document of a rejected submission. ``terminal`` is the document for a terminal, if it differs.
    ``worksheet`` fills in a given table. ``archive`` packs reports into a file.
    """

    name: str
    suffix: str = ""
    document: GradeRenderer[str] | None = None
    refusal: Callable[[TableRow[Grade]], str] | None = None
    table: Callable[[Sequence[TableRow[Grade]]], str] | None = None
    terminal: GradeRenderer[RenderableType] | None = None
    worksheet: Callable[[Sequence[TableRow[Grade]], str], FilledWorksheet] | None = None
    archive: Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]] | None = None


FORMATS: dict[str, Format] = {}


def register_document(name: str, suffix: str, view: Callable[[Grade], Any]) -> Callable[[_Writes], _Writes]:
    """Register a function that writes one grade, as seen through ``view``, with the submission if it is given."""

    def register(render: _Writes) -> _Writes:
        def render_document(grade: Grade, submission: Submission | None = None, /) -> str:
            return render(view(grade), submission)

        FORMATS[name] = replace(_find_format(name), suffix=suffix, document=render_document)
        return render

    return register


def register_refusal(name: str) -> Callable[[Callable[[TableRow[Grade]], str]], Callable[[TableRow[Grade]], str]]:
    """Register a function that writes the document of a rejected row."""

    def register(render: Callable[[TableRow[Grade]], str]) -> Callable[[TableRow[Grade]], str]:
        FORMATS[name] = replace(_find_format(name), refusal=render)
        return render

    return register


def register_table(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[Callable[[Sequence[TableRow[_V]]], str]], Callable[[Sequence[TableRow[_V]]], str]]:
    """Register a function that writes the rows of a batch, with their grades as seen through ``view``."""

    def register(render: Callable[[Sequence[TableRow[_V]]], str]) -> Callable[[Sequence[TableRow[_V]]], str]:
        FORMATS[name] = replace(
            _find_format(name), suffix=suffix, table=lambda rows: render([row.apply_view(view) for row in rows])
        )
        return render

    return register


def register_worksheet(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[
    [Callable[[Sequence[TableRow[_V]], str], FilledWorksheet]], Callable[[Sequence[TableRow[_V]], str], FilledWorksheet]
]:
    """Register a function that fills the rows of a batch into another system's table."""

    def register(
        render: Callable[[Sequence[TableRow[_V]], str], FilledWorksheet],
    ) -> Callable[[Sequence[TableRow[_V]], str], FilledWorksheet]:
        FORMATS[name] = replace(
            _find_format(name),
            suffix=suffix,
            worksheet=lambda rows, given: render([row.apply_view(view) for row in rows], given),
        )
        return render

    return register


def register_archive(
    name: str, suffix: str
) -> Callable[
    [Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]]],
    Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]],
]:
    """Register a function that packs the reports of a batch into a file and returns the students left out."""

    def register(
        pack: Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]],
    ) -> Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]]:
        FORMATS[name] = replace(_find_format(name), suffix=suffix, archive=pack)
        return pack

    return register


def register_terminal(name: str, view: Callable[[Grade], Any]) -> Callable[[_Shows], _Shows]:
    """Register a function that shows one grade, as seen through ``view``, in a terminal."""

    def register(render: _Shows) -> _Shows:
        def render_terminal(grade: Grade, submission: Submission | None = None, /) -> RenderableType:
            return render(view(grade), submission)

        FORMATS[name] = replace(_find_format(name), terminal=render_terminal)
        return render

    return register


def _find_format(name: str) -> Format:
    return FORMATS.get(name, Format(name))
