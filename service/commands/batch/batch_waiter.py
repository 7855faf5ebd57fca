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
_MIN_QUERY_SECONDS = 0.05
_MAX_QUERY_SECONDS = 0.25
_QUERIES_PER_WAIT = 20  # queries during the time waited so far
_REAP_SECONDS = 2.0


class _RateColumn(ProgressColumn):
    """Progress column with jobs a minute and the remaining time, measured since this wait began."""

    def render(self, task: Task) -> Text:
        elapsed = task.elapsed or 0.0
        completed_jobs = task.completed - task.fields["before"]
        if completed_jobs <= 0 or elapsed <= 0 or task.total is None:
            return Text("")
        rate = completed_jobs / elapsed
        remaining_time = timedelta(seconds=round((task.total - task.completed) / rate))
        return Text(f"{60 * rate:.0f} per minute, {remaining_time} left", style="progress.remaining")


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
        plot_count = self._query_progress()[0].plots_due
        self._wait("plots", lambda state: (max(plot_count, state.plots_due), plot_count - state.plots_due, 0.0))

    def _query_progress(self) -> tuple[BatchProgress, bool]:
        """Return the progress and True if the batch is paused. Each call takes time from the workers."""
        progress, state = poll_progress(self.service, self.actor, self.batch_id)
        return progress, state is BatchState.PAUSED

    def _wait(self, description: str, count: Callable[[BatchProgress], tuple[int, int, float]]) -> None:
        """Show a progress bar until everything is done.

        Args:
            description: Label of the progress bar.
            count: Returns the total, the number of finished items, and the finished fraction of running items.
        """
        total_count, initial_count, _ = count(self._query_progress()[0])
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            _RateColumn(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=self.console, transient=True) as bars:
            bar = bars.add_task(description, total=total_count, completed=initial_count, before=initial_count)
            start_time, last_reap_time = time.monotonic(), float("-inf")
            was_paused = False
            while True:
                self.restart_stopped()
                if time.monotonic() - last_reap_time >= _REAP_SECONDS:
                    self.notifier.catch_up()
                    last_reap_time = time.monotonic()
                progress, is_paused = self._query_progress()
                if is_paused is not was_paused:
                    state_text = f"is paused: robomark batch resume {self.batch_id}" if is_paused else "goes on"
                    print_note(f"batch {self.batch_id} {state_text}")
                    was_paused = is_paused
                total_count, completed_count, partial_count = count(progress)
                bars.update(bar, total=total_count, completed=min(completed_count + partial_count, total_count))
                if completed_count >= total_count:
                    return
                waiting_time = time.monotonic() - start_time
                time.sleep(min(max(_MIN_QUERY_SECONDS, waiting_time / _QUERIES_PER_WAIT), _MAX_QUERY_SECONDS))
