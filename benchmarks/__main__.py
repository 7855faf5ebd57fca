"""Prints each measurement beside its budget. Ratios and CPU time, so that a busy machine changes little.

``python -m benchmarks queue`` measures the queue alone; ``python -m benchmarks chaos`` does harm to it.
"""

from __future__ import annotations

import sys

from rich.console import Console
from rich.table import Table

from benchmarks import chaos, queue, sandbox, simulator, submission
from benchmarks.measurement import Measurement


def main(arguments: list[str]) -> int:
    """Measure, then print one table."""
    if arguments[:1] == ["chaos"]:
        return chaos.main(arguments[1:])
    if arguments[:1] == ["queue"]:
        _print(queue.measure())
    else:
        _print([*simulator.measure(), *submission.measure(), *sandbox.measure(), *queue.measure()])
    return 0


def _print(rows: list[Measurement]) -> None:
    table = Table("what", "measured", "budget", "beyond", box=None, pad_edge=False)
    for row in rows:
        table.add_row(row.what, row.measured, row.budget, row.beyond)
    Console(width=140).print(table)


sys.exit(main(sys.argv[1:]))
