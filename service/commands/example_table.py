"""How checked assignments are shown: one table for the whole catalogue, a few lines for one.

Only words; the grading is ``grading/example_check.py``.
"""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Table
from rich.text import Text

from service.grading.example_check import CheckedAssignment, ComparedMeasure, ExampleResult
from service.reports.readable import number, one_line
from submissions.assignment.examples import REFERENCE


def catalogue_table(checked: Iterable[CheckedAssignment]) -> Table:
    """A row for each assignment: marks of the reference and of the wrong solutions, time, measures."""
    table = Table(
        "section", "assignment", "of", REFERENCE, "others", "s", "measures (original)", box=None, pad_edge=False
    )
    for index in (2, 3, 5):
        table.columns[index].justify = "right"
    table.columns[1].overflow = "fold"
    for each in checked:
        table.add_row(
            each.assignment.section,
            Text(each.assignment.id, style="" if not each.problems else "red"),
            number(each.assignment.max_marks),
            " ".join(_marks(example) for example in each.examples if example.name == REFERENCE),
            " ".join(_marks(example) for example in each.examples if example.name != REFERENCE),
            f"{sum(example.seconds for example in each.examples):.1f}",
            Text("\n".join(map(_measure_words, each.measures))),
        )
    return table


def examples_table(checked: CheckedAssignment) -> Table:
    """A row for each example of one assignment."""
    table = Table("example", "marks", "loses", "as expected", "s", box=None, pad_edge=False)
    for index in (1, 4):
        table.columns[index].justify = "right"
    for example in checked.examples:
        table.add_row(
            Text(one_line(example.name, 60)),
            _marks(example),
            ", ".join(example.lost),
            Text("no", style="red") if example.problems else Text("yes", style="green"),
            f"{example.seconds:.1f}",
        )
    return table


def measures_table(checked: CheckedAssignment) -> Table:
    """What the reference measured beside the measures of the original simulator."""
    table = Table("measure", "here", "original", "unit", "", box=None, pad_edge=False)
    table.columns[1].justify = table.columns[2].justify = "right"
    for measure in checked.measures:
        table.add_row(
            measure.original.measure,
            "none" if measure.value is None else f"{measure.value:.6g}",
            f"{measure.original.value:g}",
            measure.unit,
            "" if measure.agrees else measure.original.explained or "differs",
        )
    return table


def _marks(example: ExampleResult) -> str:
    marks = "refused" if example.marks is None else number(example.marks)
    return f"{marks}!" if example.problems else marks


def _measure_words(measure: ComparedMeasure) -> str:
    original = measure.original
    value = "none" if measure.value is None else f"{measure.value:.5g}"
    why = "" if measure.agrees else f": {original.explained or 'differs'}"
    return f"{original.measure} {value} ({original.value:g}) {measure.unit}".rstrip() + why
