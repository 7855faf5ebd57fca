"""Waits for a batch: keeps the services up, sweeps, and shows how far it is, how fast, and the time left.

Grades nothing itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text

from service.queue.nudges import Nudger
from service.store import batches
from service.store.engine import Store

_LOOK_SECONDS = 0.25
_SWEEP_SECONDS = 2.0


class _Rate(ProgressColumn):
    """Hand-ins a minute and the time left, from the beginning of this wait."""

    def render(self, task: Task) -> Text:
        elapsed = task.elapsed or 0.0
        done = task.completed - task.fields["before"]
        if done <= 0 or elapsed <= 0 or task.total is None:
            return Text("")
        rate = done / elapsed
        left = timedelta(seconds=round((task.total - task.completed) / rate))
        return Text(f"{60 * rate:.0f} a minute, {left} left", style="progress.remaining")


def wait_for_batch(store: Store, nudger: Nudger, batch_id: str, console: Console, keep_up: Callable[[], None]) -> None:
    """Return when every job of the batch has ended and its plots are drawn.

    ``keep_up`` is called again and again, to start again what has ended; what it raises ends the waiting.
    """
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        _Rate(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    ) as bars:
        with store.reading() as session:
            begun = batches.progress(session, batch_id)
        marks = bars.add_task("grading", total=begun.jobs, completed=begun.ended, before=begun.ended)
        plots = bars.add_task("plots", total=None, visible=False, before=0)
        most_plots = 0
        swept = float("-inf")
        while True:
            keep_up()
            if time.monotonic() - swept >= _SWEEP_SECONDS:
                nudger.sweep()
                swept = time.monotonic()
            with store.reading() as session:
                state = batches.progress(session, batch_id)
            bars.update(marks, completed=state.ended + min(state.partial, state.jobs - state.ended))
            most_plots = max(most_plots, state.plots_due)
            if state.ended == state.jobs:
                if state.plots_due == 0:
                    return
                bars.update(plots, visible=True, total=most_plots, completed=most_plots - state.plots_due)
            time.sleep(_LOOK_SECONDS)
