"""Waiting for a batch: restarts services, requeues lost jobs, and shows progress, speed and remaining time.

This module grades nothing itself.
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

from service.commands.output import print_note
from service.operations.batch_views import BatchProgress, poll_progress
from service.operations.context import Actor, Service
from service.operations.types import BatchState
from service.queue.notifier import Notifier

#: The interval between queries grows with the waiting time, so that long waits cost the workers little.
_SHORTEST_QUERY_SECONDS = 0.05
_LONGEST_QUERY_SECONDS = 0.25
_QUERIES_PER_WAIT = 20  # queries during the time waited so far
_REAP_SECONDS = 2.0


class _RateColumn(ProgressColumn):
    """Progress column with jobs a minute and the remaining time, measured since this wait began."""

    def render(self, task: Task) -> Text:
        elapsed = task.elapsed or 0.0
        done = task.completed - task.fields["before"]
        if done <= 0 or elapsed <= 0 or task.total is None:
            return Text("")
        rate = done / elapsed
        left = timedelta(seconds=round((task.total - task.completed) / rate))
        return Text(f"{60 * rate:.0f} per minute, {left} left", style="progress.remaining")


@dataclass(frozen=True, slots=True)
class BatchWaiter:
    """Waits for one batch.

    The wait calls ``restart_stopped`` repeatedly to restart services that stopped. An exception from it ends the wait.
    """

    service: Service
    actor: Actor
    notifier: Notifier
    batch_id: str
    console: Console
    restart_stopped: Callable[[], None]

    def wait_for_marks(self) -> None:
        """Wait until every job of the batch has ended."""
        self._wait("grading", lambda state: (state.jobs, state.ended, state.partial))

    def wait_for_plots(self) -> None:
        """Wait until the plots of all graded jobs are drawn or given up."""
        most = self._query_progress()[0].plots_due
        self._wait("plots", lambda state: (max(most, state.plots_due), most - state.plots_due, 0.0))

    def _query_progress(self) -> tuple[BatchProgress, bool]:
        """Return the progress and True if the batch is paused. Each call takes time from the workers."""
        far, state = poll_progress(self.service, self.actor, self.batch_id)
        return far, state is BatchState.PAUSED

    def _wait(self, what: str, count: Callable[[BatchProgress], tuple[int, int, float]]) -> None:
        """Show a progress bar until everything is done.

        Args:
            what: Label of the progress bar.
            count: Returns the total, the number of finished items, and the finished fraction of running items.
        """
        total, before, _ = count(self._query_progress()[0])
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            _RateColumn(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=self.console, transient=True) as bars:
            bar = bars.add_task(what, total=total, completed=before, before=before)
            begun, swept = time.monotonic(), float("-inf")
            was_held = False
            while True:
                self.restart_stopped()
                if time.monotonic() - swept >= _REAP_SECONDS:
                    self.notifier.catch_up()
                    swept = time.monotonic()
                far, held = self._query_progress()
                if held is not was_held:
                    goes_on = f"is paused: robomark batch resume {self.batch_id}" if held else "goes on"
                    print_note(f"batch {self.batch_id} {goes_on}")
                    was_held = held
                total, done, partial = count(far)
                bars.update(bar, total=total, completed=min(done + partial, total))
                if done >= total:
                    return
                waited = time.monotonic() - begun
                time.sleep(min(max(_SHORTEST_QUERY_SECONDS, waited / _QUERIES_PER_WAIT), _LONGEST_QUERY_SECONDS))
