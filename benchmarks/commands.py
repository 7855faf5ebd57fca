"""What commands that only ask cost in CPU, against what importing Typer and Rich (and SQLAlchemy) costs."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.graded_store import GradedBatch, graded_batch
from benchmarks.measurement import RATIO, Measurement, command_cpu_seconds, median
from service.settings import load_settings
from service.store.engine import open_store

#: The command, as it is installed.
ROBOMARK = (sys.executable, "-c", "from service.cli import main; main()")
_BARE = "typer, rich"
_WITH_DATABASE = "typer, rich, sqlalchemy"


def measure(times: int) -> list[Measurement]:
    """Each command in turn with what it is compared with, so that the machine's load meets both."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        with open_store(load_settings(home=home)) as store:
            stored = graded_batch(store)
        return [_against(imports, name, of, home, times) for imports, name, of in _commands(stored)]


def _commands(stored: GradedBatch) -> Sequence[tuple[str, str, tuple[str, ...]]]:
    """What each is compared with, the command, and of which row."""
    return (
        (_BARE, "--help", ()),
        (_BARE, "--version", ()),
        (_BARE, "assignments list", ()),
        (_WITH_DATABASE, "batch list", ()),
        (_WITH_DATABASE, "batch status", (stored.batch,)),
        (_WITH_DATABASE, "show", (stored.job,)),
        (_WITH_DATABASE, "course policy", ()),
    )


def _against(imports: str, name: str, of: tuple[str, ...], home: Path, times: int) -> Measurement:
    environment = {"ROBOMARK_HOME": str(home)}
    # The first one compiles.
    command_cpu_seconds((*ROBOMARK, *name.split(), *of), environment)
    seconds = [
        (
            command_cpu_seconds((*ROBOMARK, *name.split(), *of), environment),
            command_cpu_seconds((sys.executable, "-c", f"import {imports}"), environment),
        )
        for _ in range(times)
    ]
    asked, imported = (median(each) for each in zip(*seconds, strict=True))
    return Measurement(
        f"robomark {name}, CPU against import {imports}",
        asked / imported,
        RATIO,
        budget=3 if imports == _BARE else 2,
        beyond=1.5,
        told=f"{asked:.2f} s against {imported:.2f} s",
    )
