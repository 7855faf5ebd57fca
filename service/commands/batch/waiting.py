"""Waits for a batch: keeps the services up, sweeps, and shows how far it is, how fast, and the time left.

Grades nothing itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.text import Text
from sqlalchemy import select

from service.commands.shown import note
from service.queue.notifier import Notifier
from service.store import batches
from service.store.engine import Store
from service.store.models import Batch
from service.store.states import BatchState

_LOOK_SECONDS = 0.25
_REAP_SECONDS = 2.0


class _Rate(ProgressColumn):
    """How many a minute and the time left, from the beginning of this wait."""

    def render(self, task: Task) -> Text:
        elapsed = task.elapsed or 0.0
        done = task.completed - task.fields["before"]
        if done <= 0 or elapsed <= 0 or task.total is None:
            return Text("")
        rate = done / elapsed
        left = timedelta(seconds=round((task.total - task.completed) / rate))
        return Text(f"{60 * rate:.0f} a minute, {left} left", style="progress.remaining")


@dataclass(frozen=True, slots=True)
class Waiting:
    """Somebody who waits for a batch.

    ``keep_up`` is called again and again, to start again what has ended; what it raises ends the waiting.
    """

    store: Store
    notifier: Notifier
    batch_id: str
    console: Console
    keep_up: Callable[[], None]

    def for_marks(self) -> None:
        """Return when every job of the batch has ended."""
        self._wait("grading", lambda state: (state.jobs, state.ended, state.partial))

    def for_plots(self) -> None:
        """Return when the plots of all graded jobs are drawn, or given up."""
        most = self._look().plots_due
        self._wait("plots", lambda state: (max(most, state.plots_due), most - state.plots_due, 0.0))

    def _held(self) -> bool:
        with self.store.reading() as session:
            state = session.scalar(select(Batch.state).where(Batch.id == self.batch_id))
        return state is BatchState.PAUSED

    def _look(self) -> batches.BatchProgress:
        with self.store.reading() as session:
            return batches.progress(session, self.batch_id)

    def _wait(self, what: str, count: Callable[[batches.BatchProgress], tuple[int, int, float]]) -> None:
        """``count`` gives how many there are, how many are done, and how much of the next ones."""
        total, before, _ = count(self._look())
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            _Rate(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=self.console, transient=True) as bars:
            bar = bars.add_task(what, total=total, completed=before, before=before)
            swept = float("-inf")
            was_held = False
            while True:
                if (held := self._held()) is not was_held:
                    goes_on = f"is paused: robomark batch resume {self.batch_id}" if held else "goes on"
                    note(f"batch {self.batch_id} {goes_on}")
                    was_held = held
                self.keep_up()
                if time.monotonic() - swept >= _REAP_SECONDS:
                    self.notifier.catch_up()
                    swept = time.monotonic()
                total, done, partial = count(self._look())
                bars.update(bar, total=total, completed=min(done + partial, total))
                if done >= total:
                    return
                time.sleep(_LOOK_SECONDS)
