"""Tables of checked assignments: one table for the whole catalogue, or details of one assignment.

This module only formats. ``grading/example_check.py`` does the grading.
"""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Table
from rich.text import Text

from service.commands.output import create_table
from service.grading.example_check import CheckedAssignment, ComparedMeasure, ExampleResult
from service.grading.no_effort import NOTABLE_SHARE
from service.reports.display_text import format_decimal, to_one_line
from submissions.assignment.folder import REFERENCE


def build_catalogue_table(checked_assignments: Iterable[CheckedAssignment]) -> Table:
    """Return a table with a row for each assignment: marks of the reference and wrong solutions, time, measures."""
    numbers = ("of", REFERENCE, "no effort", "s")
    table = create_table(
        "section", "assignment", "of", REFERENCE, "others", "no effort", "s", "measures (original)", right=numbers
    )
    for checked_assignment in checked_assignments:
        table.add_row(
            checked_assignment.assignment.section,
            Text(checked_assignment.assignment.id, style="" if not checked_assignment.problems else "red"),
            format_decimal(checked_assignment.assignment.max_marks),
            " ".join(
                _format_example_marks(example) for example in checked_assignment.examples if example.name == REFERENCE
            ),
            " ".join(
                _format_example_marks(example) for example in checked_assignment.examples if example.name != REFERENCE
            ),
            _format_share(max((each.share for each in checked_assignment.no_effort), default=0.0)),
            f"{sum(example.seconds for example in checked_assignment.examples):.1f}",
            "; ".join(map(_format_measure, checked_assignment.measures)),
        )
    return table


def build_examples_table(checked: CheckedAssignment) -> Table:
    """Return a table with a row for each example of one assignment."""
    table = create_table("example", "marks", "loses", "as expected", "s", right=("marks", "s"))
    for example in checked.examples:
        table.add_row(
            to_one_line(example.name, 60),
            _format_example_marks(example),
            ", ".join(example.lost),
            Text("no", style="red") if example.problems else Text("yes", style="green"),
            f"{example.seconds:.1f}",
        )
    return table


def build_no_effort_table(checked: CheckedAssignment) -> Table:
    """Return a table with the marks of each submission without effort."""
    table = create_table("without effort", "marks", "share", right=("marks", "share"))
    for result in checked.no_effort:
        marks = "refused" if result.marks is None else format_decimal(result.marks)
        table.add_row(result.description, marks, _format_share(result.share))
    return table


def build_measures_table(checked: CheckedAssignment) -> Table:
    """Return a table that compares the reference's measures with those of the original simulator."""
    table = create_table("measure", "here", "original", "unit", "", right=("here", "original"))
    for measure in checked.measures:
        table.add_row(
            measure.original.measure,
            "none" if measure.value is None else f"{measure.value:.6g}",
            f"{measure.original.value:g}",
            measure.unit,
            "" if measure.is_close else measure.original.explained or "differs",
        )
    return table


def _format_example_marks(example: ExampleResult) -> str:
    marks = "refused" if example.marks is None else format_decimal(example.marks)
    return f"{marks}!" if example.problems else marks


def _format_share(share: float) -> Text:
    """Return the share in percent; red if the assignment should be changed."""
    return Text(f"{share:.0%}", style="red" if share >= NOTABLE_SHARE else "")


def _format_measure(measure: ComparedMeasure) -> str:
    original = measure.original
    value = "none" if measure.value is None else f"{measure.value:.5g}"
    note = "" if measure.is_close else f": {original.explained or 'differs'}"
    return f"{original.measure} {value} ({original.value:g}) {measure.unit}".rstrip() + note
