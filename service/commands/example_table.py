"""Tables of checked assignments: one table for the whole catalogue, or details of one assignment.

This module only formats. ``grading/example_check.py`` does the grading.
"""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Table
from rich.text import Text

from service.commands.shown import table
from service.grading.example_check import CheckedAssignment, ComparedMeasure, ExampleResult
from service.reports.readable import number, one_line
from submissions.assignment.folder import REFERENCE


def catalogue_table(checked: Iterable[CheckedAssignment]) -> Table:
    """Return a table with a row for each assignment: marks of the reference and wrong solutions, time, measures."""
    numbers = ("of", REFERENCE, "s")
    made = table("section", "assignment", "of", REFERENCE, "others", "s", "measures (original)", right=numbers)
    for each in checked:
        made.add_row(
            each.assignment.section,
            Text(each.assignment.id, style="" if not each.problems else "red"),
            number(each.assignment.max_marks),
            " ".join(_marks(example) for example in each.examples if example.name == REFERENCE),
            " ".join(_marks(example) for example in each.examples if example.name != REFERENCE),
            f"{sum(example.seconds for example in each.examples):.1f}",
            "; ".join(map(_measure_words, each.measures)),
        )
    return made


def examples_table(checked: CheckedAssignment) -> Table:
    """Return a table with a row for each example of one assignment."""
    made = table("example", "marks", "loses", "as expected", "s", right=("marks", "s"))
    for example in checked.examples:
        made.add_row(
            one_line(example.name, 60),
            _marks(example),
            ", ".join(example.lost),
            Text("no", style="red") if example.problems else Text("yes", style="green"),
            f"{example.seconds:.1f}",
        )
    return made


def measures_table(checked: CheckedAssignment) -> Table:
    """Return a table that compares the reference's measures with those of the original simulator."""
    made = table("measure", "here", "original", "unit", "", right=("here", "original"))
    for measure in checked.measures:
        made.add_row(
            measure.original.measure,
            "none" if measure.value is None else f"{measure.value:.6g}",
            f"{measure.original.value:g}",
            measure.unit,
            "" if measure.agrees else measure.original.explained or "differs",
        )
    return made


def _marks(example: ExampleResult) -> str:
    marks = "refused" if example.marks is None else number(example.marks)
    return f"{marks}!" if example.problems else marks


def _measure_words(measure: ComparedMeasure) -> str:
    original = measure.original
    value = "none" if measure.value is None else f"{measure.value:.5g}"
    why = "" if measure.agrees else f": {original.explained or 'differs'}"
    return f"{original.measure} {value} ({original.value:g}) {measure.unit}".rstrip() + why
