"""Tables of graded mutants: the numbers by operator or by assignment, and the mutants that keep full marks.

This module only formats. ``mutation/mutant_check.py`` does the grading.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from service.commands.output import create_table
from service.mutation.mutant_check import MutantCheck, OperatorCounts
from service.reports.display_text import to_one_line

_NUMBERS = ("mutants", "equivalent", "killed", "survivors")


def build_mutant_tables(check: MutantCheck) -> Iterator[Table]:
    """Yield the numbers by operator, and the survivors if there are any; nothing without mutants."""
    if not check.results:
        return
    table = create_table("operator", *_NUMBERS, right=_NUMBERS)
    for counts in check.counts:
        table.add_row(counts.operator, *_format_counts(counts))
    table.add_row("total", *_format_counts(check.total))
    yield table
    yield from _build_survivor_table([check])


def build_catalogue_mutant_tables(checks: Sequence[MutantCheck]) -> Iterator[Table]:
    """Yield the numbers by assignment, and the survivors of all assignments if there are any."""
    table = create_table("assignment", *_NUMBERS, right=_NUMBERS)
    for check in checks:
        table.add_row(check.assignment, *_format_counts(check.total))
    yield table
    yield from _build_survivor_table(checks)


def _build_survivor_table(checks: Sequence[MutantCheck]) -> Iterator[Table]:
    if not any(check.survivors for check in checks):
        return
    table = create_table("keeps full marks", "file", "line", "operator", "change", right=("line",))
    for check in checks:
        for result in check.survivors:
            mutant = result.mutant
            change = f"{to_one_line(mutant.old, 60)} -> {to_one_line(mutant.new, 60)}"
            table.add_row(check.assignment, mutant.file, str(mutant.line), mutant.operator, change)
    yield table


def _format_counts(counts: OperatorCounts) -> tuple[str | Text, ...]:
    survivors = Text(str(counts.survivors), style="red" if counts.survivors else "")
    return str(counts.mutants), str(counts.equivalent), str(counts.killed), survivors
