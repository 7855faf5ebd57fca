"""CPU costs of query commands, compared with the import of Typer and Rich, and of SQLAlchemy where used."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.graded_store import GradedBatch, create_graded_batch
from benchmarks.measurement import RATIO, Measurement, measure_command_cpu, median
from service.settings import load_settings
from service.store.engine import open_store

#: The installed command.
ROBOMARK = (sys.executable, "-c", "from service.cli import main; main()")
_BARE = "typer, rich"
_WITH_DATABASE = "typer, rich, sqlalchemy"


def measure(times: int) -> list[Measurement]:
    """Measure each command alternately with its baseline, so that the machine's load affects both."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        with open_store(load_settings(home=home)) as store:
            batch = create_graded_batch(store)
        return [_compare_with_import(imports, name, of, home, times) for imports, name, of in _list_commands(batch)]


def _list_commands(batch: GradedBatch) -> Sequence[tuple[str, str, tuple[str, ...]]]:
    """Return the baseline, the command and the table row of each measurement."""
    return (
        (_BARE, "--help", ()),
        (_BARE, "--version", ()),
        (_BARE, "assignments list", ()),
        (_WITH_DATABASE, "batch list", ()),
        (_WITH_DATABASE, "batch status", (batch.batch,)),
        (_WITH_DATABASE, "show", (batch.job,)),
        (_WITH_DATABASE, "course policy", ()),
    )


def _compare_with_import(imports: str, name: str, arguments: tuple[str, ...], home: Path, times: int) -> Measurement:
    environment = {"ROBOMARK_HOME": str(home)}
    # The first run compiles bytecode.
    measure_command_cpu((*ROBOMARK, *name.split(), *arguments), environment)
    seconds = [
        (
            measure_command_cpu((*ROBOMARK, *name.split(), *arguments), environment),
            measure_command_cpu((sys.executable, "-c", f"import {imports}"), environment),
        )
        for _ in range(times)
    ]
    command_seconds, import_seconds = (median(each) for each in zip(*seconds, strict=True))
    return Measurement(
        f"robomark {name}, CPU against import {imports}",
        command_seconds / import_seconds,
        RATIO,
        budget=3 if imports == _BARE else 2,
        beyond=1.5,
        details=f"{command_seconds:.2f} s against {import_seconds:.2f} s",
    )
