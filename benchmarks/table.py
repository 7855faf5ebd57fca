"""The table on the screen, its JSON file, and the comparison with a recorded run. Measures nothing."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from benchmarks.calibration import LOOP
from benchmarks.measurement import Measurement

#: The recorded run for comparisons, in version control.
RECORDED = Path(__file__).parent / "recorded.json"
#: The last run on this machine.
LATEST = Path(__file__).parent / "latest.json"


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The values of an earlier run by name."""

    at: str
    values: dict[str, float]

    def scale_to_machine(self, loop_seconds: float | None, row: Measurement) -> float | None:
        """Return the earlier value, scaled to a machine with this loop time, or None if it was not measured."""
        value, recorded_loop = self.values.get(row.what), self.values.get(LOOP)
        if value is None or not recorded_loop or not loop_seconds or row.what == LOOP:
            return value
        return value * (loop_seconds / recorded_loop) ** row.unit.slowness


def load_recorded_run(path: Path = RECORDED) -> RecordedRun | None:
    """Return the run in the file, or None if there is none."""
    if not path.exists():
        return None
    contents = json.loads(path.read_text())
    return RecordedRun(contents["at"], {line["what"]: line["value"] for line in contents["lines"]})


def write_rows(path: Path, rows: Sequence[Measurement]) -> None:
    """Replace the rows with the same names in the file. Other rows stay."""
    lines = {line["what"]: line for line in json.loads(path.read_text())["lines"]} if path.exists() else {}
    lines |= {row.what: _build_entry(row) for row in rows}
    contents = {
        "at": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "python": platform.python_version(),
        "lines": list(lines.values()),
    }
    path.write_text(json.dumps(contents, indent=1) + "\n")


def print_rows(rows: Sequence[Measurement], recorded_run: RecordedRun | None) -> None:
    """Print each row with its budget and the recorded value, scaled to this machine."""
    loop = next((row.value for row in rows if row.what == LOOP), None)
    table = Table("what", box=None, pad_edge=False)
    for heading in ("measured", "budget", "beyond", "recorded"):
        table.add_column(heading, justify="right")
    table.add_column("spread")
    for row in rows:
        recorded_value = None if recorded_run is None else recorded_run.scale_to_machine(loop, row)
        table.add_row(
            Text(row.what),
            Text(row.unit.format_value(row.value), style="red" if row.misses else ""),
            *(
                "" if value is None else row.unit.format_value(value)
                for value in (row.budget, row.beyond, recorded_value)
            ),
            row.details,
        )
    console = Console(width=170)
    console.print(table)
    if recorded_run is not None:
        console.print(f"recorded: {recorded_run.at}; times are scaled by the loop where both runs have it")
    for row in rows:
        if row.gates:
            console.print(f"misses its budget: {row.what}: {row.unit.format_value(row.value)}", style="red")


def _build_entry(row: Measurement) -> dict[str, Any]:
    optional = {"budget": row.budget, "beyond": row.beyond, "spread": row.details or None}
    return {"what": row.what, "value": round(row.value, 6), "unit": row.unit.word.strip()} | {
        name: value for name, value in optional.items() if value is not None
    }
