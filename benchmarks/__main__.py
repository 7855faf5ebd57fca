"""Prints each measurement beside its budget. Ratios and CPU time, so that a busy machine changes little."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from benchmarks import hand_in, simulator, walls
from benchmarks.measurement import Measurement


def main() -> None:
    """Measure, then print one table."""
    rows: list[Measurement] = [*simulator.measure(), *hand_in.measure(), *walls.measure()]
    table = Table("what", "measured", "budget", "beyond", box=None, pad_edge=False)
    for row in rows:
        table.add_row(row.what, row.measured, row.budget, row.beyond)
    Console(width=140).print(table)


main()
