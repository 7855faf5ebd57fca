"""The three Celery tasks, and the objects that a pool child keeps for them: the runner and the database.

A task is a notification without content; the work is claimed in the database. The worker's main process knows the tasks
only by name: their code is loaded in the pool children.
"""

from __future__ import annotations

import gc
import os
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import structlog
from celery import Task, current_app, shared_task, signals

from service.queue.celery_app import GRADE_TASK, NO_SANDBOX, PLOT_TASK, TRYOUT_TASK
from service.queue.logs import configure_logging
from service.settings import Settings, load_settings

if TYPE_CHECKING:
    from service.grading.trial_runner import TrialRunner
    from service.queue.self_test import Watch
    from service.store.engine import Store

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PoolChild:
    """The objects that a pool child keeps from its first task until it ends."""

    settings: Settings
    store: Store
    runner: TrialRunner
    watch: Watch

    def close(self) -> None:
        """Stop the self-tests, and close the runner and the store."""
        self.watch.end()
        self.runner.close()
        self.store.close()


class WarmTask(Task):  # type: ignore[type-arg]
    """A task with access to the objects of its pool child, which are created only after the fork."""

    abstract = True

    @property
    def child(self) -> PoolChild:
        """The objects of this process, created on first access."""
        return _children.child


class _Children:
    """Holder of this process's pool child, created on first access."""

    @cached_property
    def child(self) -> PoolChild:
        from responders.sandbox import control_group
        from responders.sandbox.manager import Sandboxes
        from responders.sandbox.zygote import FULL, NONE
        from service.queue.right_answers import ANSWERED_BY, right_answer

        settings = load_settings()
        unsafe = current_app.conf.get(NO_SANDBOX)
        group = None if unsafe else control_group.for_this_process(settings.slot_memory_mb)
        sandboxes = Sandboxes(NONE if unsafe else FULL, group)
        try:
            # They load their imports while this process continues.
            right = right_answer(settings.home / "run")
            for role in ANSWERED_BY if right.is_ours_to_ask() else ():
                sandboxes.begin(role, ())
            sandboxes.begin("robot", ())
            from service.grading.slots import Slots
            from service.grading.trial_runner import TrialRunner
            from service.queue.alive import worker_name
            from service.queue.self_test import Watch
            from service.store.engine import open_store

            store, runner = open_store(settings), TrialRunner(sandboxes, Slots(settings.home / "run"))
        except BaseException:
            sandboxes.close()
            raise
        watch = Watch(store, runner, worker_name(), settings.self_test_seconds, right)
        return PoolChild(settings, store, runner, watch)

    def drop(self) -> None:
        """Close the objects; the next task creates new ones."""
        if "child" in vars(self):
            self.child.close()
            del self.child


_children = _Children()


@shared_task(bind=True, base=WarmTask, name=GRADE_TASK)
def grade_notice(task: WarmTask) -> None:
    """Grade the next job, then notify for its plots."""
    from service.queue.alive import worker_name
    from service.queue.grading_job import JobOutcome, grade_next

    child = task.child
    child.watch.keep_looking()
    with child.watch.busy():
        outcome = grade_next(child.store, child.settings, child.runner, worker_name())
    if outcome is JobOutcome.GRADED:
        from service.queue.notifier import Notifier

        Notifier(task.app, child.store, child.settings).plot()
    elif outcome is JobOutcome.HOST_FAULT:
        # The error may have damaged an object that is reused.
        _children.drop()


@shared_task(bind=True, base=WarmTask, name=TRYOUT_TASK)
def tryout_notice(task: WarmTask) -> None:
    """Run the oldest test run."""
    from service.queue.trying import try_next

    child = task.child
    child.watch.keep_looking()
    with child.watch.busy():
        ran_well = try_next(child.store, child.settings, child.runner)
    if not ran_well:
        # The error may have damaged an object that is reused.
        _children.drop()


@shared_task(bind=True, base=WarmTask, name=PLOT_TASK)
def plot_notice(task: WarmTask) -> None:
    """Draw the plots that are due longest."""
    from service.queue.grading_job import plot_next

    child = task.child
    try:
        plot_next(child.store, child.settings)
    except Exception:
        # The row still marks them as due, so they are retried a limited number of times.
        _log.exception("plots.failed")


@signals.setup_logging.connect
def _log_as_we_do(**_: object) -> None:
    configure_logging(load_settings().log_level)


@signals.worker_process_init.connect
def _begin(**_: object) -> None:
    # If memory runs out, a pool child is killed before its parent, and student code before both.
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("300")
    # Imports create little garbage, and collecting it would take a tenth of their time.
    gc.disable()
    # An exception here would end the pool child and each successor; an exception in a task is stored.
    try:
        child = _children.child
        # Otherwise the first job would wait for it.
        from service.queue import grading_job  # noqa: F401

        child.runner.check_sandbox()
        child.watch.begin()
        child.watch.keep_looking()
    except Exception:
        _log.exception("pool_child.cold")
    finally:
        gc.freeze()
        gc.enable()


@signals.worker_process_shutdown.connect
def _end(exitcode: int, **_: object) -> None:
    _children.drop()
    # Celery would sleep for a second before its parent, which only waits for the end, kills it.
    os._exit(exitcode)
