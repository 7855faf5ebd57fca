"""Tables of graded mutants: the numbers by operator or by assignment, and the mutants that keep full marks.

This module only formats. ``mutation/mutant_check.py`` does the grading.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.table import Table
from rich.text import Text

from service.commands.output import create_table
from service.mutation.mutant_check import MutantCheck, OperatorCounts
from service.mutation.mutants import Mutant
from service.reports.display_text import to_one_line

_NUMBERS = ("mutants", "equivalent", "killed", "survivors", "unexplained")


def build_mutant_tables(check: MutantCheck) -> Iterator[Table]:
    """Yield the numbers by operator, the unexplained and the explained survivors; nothing without mutants."""
    if not check.results:
        return
    table = create_table("operator", *_NUMBERS, right=_NUMBERS)
    for counts in check.counts:
        table.add_row(counts.operator, *_format_counts(counts))
    table.add_row("total", *_format_counts(check.total))
    yield table
    yield from _build_survivor_table([check])
    yield from _build_reason_table(check)


def build_catalogue_mutant_tables(checks: Sequence[MutantCheck]) -> Iterator[Table]:
    """Yield the numbers by assignment, and the unexplained survivors of all assignments."""
    table = create_table("assignment", *_NUMBERS, right=_NUMBERS)
    for check in checks:
        table.add_row(check.assignment, *_format_counts(check.total))
    yield table
    yield from _build_survivor_table(checks)


def _build_survivor_table(checks: Sequence[MutantCheck]) -> Iterator[Table]:
    if not any(check.total.unexplained for check in checks):
        return
    table = create_table("keeps full marks", "file", "line", "operator", "change", right=("line",))
    for check in checks:
        for result in check.survivors:
            if not result.reason:
                mutant = result.mutant
                table.add_row(check.assignment, mutant.file, str(mutant.line), mutant.operator, _format_change(mutant))
    yield table


def _build_reason_table(check: MutantCheck) -> Iterator[Table]:
    explained = [each for each in check.survivors if each.reason]
    if not explained:
        return
    table = create_table("also right", "line", "change", "reason", right=("line",))
    for result in explained:
        mutant = result.mutant
        table.add_row(mutant.file, str(mutant.line), _format_change(mutant), to_one_line(result.reason, 500))
    yield table


def _format_change(mutant: Mutant) -> str:
    return f"{to_one_line(mutant.old, 60)} -> {to_one_line(mutant.new, 60)}"


def _format_counts(counts: OperatorCounts) -> tuple[str | Text, ...]:
    unexplained = Text(str(counts.unexplained), style="red" if counts.unexplained else "")
    return str(counts.mutants), str(counts.equivalent), str(counts.killed), str(counts.survivors), unexplained
