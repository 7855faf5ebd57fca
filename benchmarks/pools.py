"""Mean trials that decide a boundary, by the true share, beside a fixed number of trials with the same error.

Run it with ``python -m benchmarks pools``. Pools of 1000 trials take a minute each.
"""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from benchmarks.harness.pool_decisions import compute_fixed_number, decide_exactly
from service.grading.pools.pool_values import ERROR_OF_GRADE

_BOUNDARIES = (0.5, 0.7, 0.9)
_SIZES = (50, 200, 1000)
_SHARES = (0.3, 0.5, 0.6, 0.64, 0.7, 0.76, 0.8, 0.9, 1.0)


def main(_arguments: list[str]) -> int:
    """Print the table."""
    table = Table("boundary", "pool", "wrong, at most", box=None)
    for share in _SHARES:
        table.add_column(f"{share:.0%}", justify="right")
    for boundary in _BOUNDARIES:
        for size in _SIZES:
            decisions = decide_exactly(size, boundary, ERROR_OF_GRADE)
            error = float(decisions.wrong.max())
            cells = []
            for share in _SHARES:
                passes = round(share * size)
                fixed_number = compute_fixed_number(size, boundary, passes, error)
                cells.append(f"{decisions.trials[passes]:.0f} / {fixed_number}")
            table.add_row(f"{boundary:.0%}", f"{size}", f"{error:.1%}", *cells)
    Console(width=150).print(table)
    return 0
