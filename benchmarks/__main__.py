"""Prints each measurement beside its budget. Ratios and CPU time, so that a busy machine changes little.

``python -m benchmarks queue rows`` measures these two alone. ``chaos``, ``capacity``, ``costs``, ``loads``,
``plans`` and ``pools`` are no part of the table (docs/performance.md).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from types import MappingProxyType

from benchmarks import (
    appeal,
    calibration,
    capacity,
    chaos,
    claims,
    cold_batch,
    commands,
    costs,
    grading,
    growth,
    loads,
    memory,
    notebook_cells,
    original,
    plots,
    pools,
    queue,
    ready,
    rows,
    sandbox,
    simulator,
    statement_log,
    submission,
    table,
    web,
)
from benchmarks.measurement import Measurement

#: The measurement groups. Each takes the number of repetitions and returns its rows.
GROUPS: Mapping[str, Callable[[int], list[Measurement]]] = MappingProxyType(
    {
        "calibration": calibration.measure,
        "commands": commands.measure,
        "grading": grading.measure,
        "simulator": simulator.measure,
        "original": original.measure,
        "growth": growth.measure,
        "plots": plots.measure,
        "memory": memory.measure,
        "cold_batch": cold_batch.measure,
        "ready": ready.measure,
        "submission": submission.measure,
        "sandbox": sandbox.measure,
        "appeal": appeal.measure,
        "rows": rows.measure,
        "statement_log": statement_log.measure,
        "claims": claims.measure,
        "queue": queue.measure,
        "web": web.measure,
        "notebook_cells": notebook_cells.measure,
    }
)
#: The groups of ``--quick``, which together take less than a minute.
_QUICK = ("calibration", "commands", "grading", "simulator", "original", "growth")
_OTHERS: Mapping[str, Callable[[list[str]], int]] = MappingProxyType(
    {
        "capacity": capacity.main,
        "chaos": chaos.main,
        "costs": costs.main,
        "loads": loads.main,
        "plans": rows.main,
        "pools": pools.main,
    }
)


def main(arguments: list[str]) -> int:
    """Run the measurements and print one table. Return 1 if a ratio misses its budget."""
    if arguments and arguments[0] in _OTHERS:
        return _OTHERS[arguments[0]](arguments[1:])
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("group", nargs="*", help="what is measured; all by default")
    parser.add_argument("--quick", action="store_true", help="what can be measured in less than a minute")
    parser.add_argument("--record", action="store_true", help="keep the lines as what later runs are compared with")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.group if name not in GROUPS]:
        parser.error(f"there is no group {unknown[0]}; there are {', '.join(GROUPS)}")
    names = options.group or (_QUICK if options.quick else tuple(GROUPS))
    recorded_run = table.load_recorded_run()
    measured_rows: list[Measurement] = []
    try:
        for name in names:
            measured_rows += GROUPS[name](1 if options.quick else 5)
    finally:  # a group that fails does not cost the others their rows
        table.print_rows(measured_rows, recorded_run)
        table.write_rows(table.LATEST, measured_rows)
    if options.record:
        table.write_rows(table.RECORDED, measured_rows)
    return int(any(row.gates for row in measured_rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
