"""The registry of output formats. Each format registers itself, with its suffix and its view of a grade.

A format writes a document for one grade, one table for many, or both. This module renders nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol, TypeAlias, TypeVar

from service.grading.grade import Grade
from service.reports.rows import ReportPage, TableRow
from submissions.submission import Submission

if TYPE_CHECKING:
    from rich.console import RenderableType

_V = TypeVar("_V")
_F = TypeVar("_F", bound=Callable[..., object])
_T = TypeVar("_T", covariant=True)
_VC = TypeVar("_VC", contravariant=True)

RowWriter: TypeAlias = Callable[[TableRow[Grade]], str]
TableWriter: TypeAlias = Callable[[Sequence[TableRow[_V]]], str]
Packer: TypeAlias = Callable[[Iterable[ReportPage], BinaryIO], tuple[str, ...]]


class ViewRenderer(Protocol[_VC, _T]):
    """Renders one grade as its reader sees it, with source lines if the submission is given."""

    def __call__(self, view: _VC, submission: Submission | None = None) -> _T:
        """Render the grade. Without the submission there is no excerpt."""


class GradeRenderer(Protocol[_T]):
    """Renders one grade, with source lines if the submission is given."""

    def __call__(self, grade: Grade, submission: Submission | None = None, /) -> _T:
        """Render the grade. Without the submission there is no excerpt."""


@dataclass(frozen=True, slots=True)
class FilledWorksheet:
    """A table from another system with the grades filled in, and the rows that did not fit."""

    text: str
    left_over: tuple[str, ...] = ()


WorksheetWriter: TypeAlias = Callable[[Sequence[TableRow[_V]], str], FilledWorksheet]


@dataclass(frozen=True, slots=True)
class Format:
    """An output format: ``document`` writes one grade to a file, ``table`` all grades of a batch to one file.

    ``refusal`` is the document of a rejected submission. ``terminal`` is the document for a terminal, if it differs.
    ``worksheet`` fills in a given table. ``archive`` packs reports into a file.
    """

    name: str
    suffix: str = ""
    document: GradeRenderer[str] | None = None
    refusal: RowWriter | None = None
    table: TableWriter[Grade] | None = None
    terminal: GradeRenderer[RenderableType] | None = None
    worksheet: WorksheetWriter[Grade] | None = None
    archive: Packer | None = None


FORMATS: dict[str, Format] = {}


def register_document(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[ViewRenderer[_V, str]], ViewRenderer[_V, str]]:
    """Register a function that writes one grade, as seen through ``view``, with the submission if it is given."""
    return _register(name, lambda render: {"suffix": suffix, "document": _apply_view(view, render)})


def register_terminal(
    name: str, view: Callable[[Grade], _V]
) -> Callable[[ViewRenderer[_V, RenderableType]], ViewRenderer[_V, RenderableType]]:
    """Register a function that shows one grade, as seen through ``view``, in a terminal."""
    return _register(name, lambda render: {"terminal": _apply_view(view, render)})


def register_refusal(name: str) -> Callable[[RowWriter], RowWriter]:
    """Register a function that writes the document of a rejected row."""
    return _register(name, lambda render: {"refusal": render})


def register_table(name: str, suffix: str, view: Callable[[Grade], _V]) -> Callable[[TableWriter[_V]], TableWriter[_V]]:
    """Register a function that writes the rows of a batch, with their grades as seen through ``view``."""
    return _register(
        name,
        lambda render: {"suffix": suffix, "table": lambda rows: render([row.apply_view(view) for row in rows])},
    )


def register_worksheet(
    name: str, suffix: str, view: Callable[[Grade], _V]
) -> Callable[[WorksheetWriter[_V]], WorksheetWriter[_V]]:
    """Register a function that fills the rows of a batch into another system's table."""
    return _register(
        name,
        lambda render: {
            "suffix": suffix,
            "worksheet": lambda rows, given: render([row.apply_view(view) for row in rows], given),
        },
    )


def register_archive(name: str, suffix: str) -> Callable[[Packer], Packer]:
    """Register a function that packs the reports of a batch into a file and returns the students left out."""
    return _register(name, lambda pack: {"suffix": suffix, "archive": pack})


def _apply_view(view: Callable[[Grade], _V], render: ViewRenderer[_V, _T]) -> GradeRenderer[_T]:
    return lambda grade, submission=None, /: render(view(grade), submission)


def _register(name: str, describe: Callable[[_F], dict[str, Any]]) -> Callable[[_F], _F]:
    """Return a decorator that adds the parts of a format that ``describe`` makes of the decorated function."""

    def register(function: _F) -> _F:
        FORMATS[name] = replace(FORMATS.get(name, Format(name)), **describe(function))
        return function

    return register
