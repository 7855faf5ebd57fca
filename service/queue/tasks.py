"""The four Celery tasks, and the objects that a pool child keeps for them: the runner and the database.

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

from service.queue.celery_app import EXPLAIN_TASK, GRADE_TASK, NO_SANDBOX, PLOT_TASK, TEST_RUN_TASK
from service.queue.logs import configure_logging
from service.settings import Settings, load_settings

if TYPE_CHECKING:
    from service.grading.trial_runner import TrialRunner
    from service.queue.self_test import SelfTester
    from service.store.engine import Store

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PoolChild:
    """The objects that a pool child keeps from its first task until it ends."""

    settings: Settings
    store: Store
    runner: TrialRunner
    self_tester: SelfTester

    def close(self) -> None:
        """Stop the self-tests, and close the runner and the store."""
        self.self_tester.end()
        self.runner.close()
        self.store.close()


class WarmTask(Task):  # type: ignore[type-arg]
    """A task with access to the objects of its pool child, which are created only after the fork."""

    abstract = True

    @property
    def child(self) -> PoolChild:
        """The objects of this process, created on first access."""
        return _child_holder.child


class _ChildHolder:
    """Holder of this process's pool child, created on first access."""

    @cached_property
    def child(self) -> PoolChild:
        from responders.sandbox import control_group
        from responders.sandbox.isolation import FULL_ISOLATION, NO_ISOLATION
        from responders.sandbox.manager import Sandboxes
        from service.queue.self_test_record import SELF_TEST_ROLES, open_self_test_record

        settings = load_settings()
        is_unsafe = current_app.conf.get(NO_SANDBOX)
        group = None if is_unsafe else control_group.create_slot_group(settings.slot_memory_mb)
        sandboxes = Sandboxes(NO_ISOLATION if is_unsafe else FULL_ISOLATION, group)
        try:
            # They load their imports while this process continues.
            self_test_record = open_self_test_record(settings.home / "run")
            for role in SELF_TEST_ROLES if self_test_record.should_run_here() else ():
                sandboxes.begin(role, ())
            sandboxes.begin("robot", ())
            from service.grading.grader_locks import GraderLocks
            from service.grading.trial_runner import TrialRunner
            from service.queue.live_workers import read_worker_name
            from service.queue.self_test import SelfTester
            from service.store.engine import open_store

            store, runner = open_store(settings), TrialRunner(sandboxes, GraderLocks(settings.home / "run"))
        except BaseException:
            sandboxes.close()
            raise
        watch = SelfTester(store, runner, read_worker_name(), settings.self_test_seconds, self_test_record)
        return PoolChild(settings, store, runner, watch)

    def drop(self) -> None:
        """Close the objects; the next task creates new ones."""
        if "child" in vars(self):
            self.child.close()
            del self.child


_child_holder = _ChildHolder()


@shared_task(bind=True, base=WarmTask, name=GRADE_TASK)
def grade_notified_job(task: WarmTask) -> None:
    """Grade the next job, then notify for its plots."""
    from service.queue.grading_job import GradingOutcome, grade_next_job
    from service.queue.live_workers import read_worker_name

    child = task.child
    child.self_tester.repeat_in_thread()
    with child.self_tester.busy():
        outcome = grade_next_job(child.store, child.settings, child.runner, read_worker_name())
    if outcome is GradingOutcome.GRADED:
        from service.queue.notifier import Notifier

        notifier = Notifier(task.app, child.store, child.settings)
        notifier.plot()
        notifier.explain()
    elif outcome is GradingOutcome.HOST_FAULT:
        # The error may have damaged an object that is reused.
        _child_holder.drop()


@shared_task(bind=True, base=WarmTask, name=TEST_RUN_TASK)
def run_notified_test(task: WarmTask) -> None:
    """Run the oldest test run."""
    from service.queue.test_run_job import run_next_test

    child = task.child
    child.self_tester.repeat_in_thread()
    with child.self_tester.busy():
        has_succeeded = run_next_test(child.store, child.settings, child.runner)
    if not has_succeeded:
        # The error may have damaged an object that is reused.
        _child_holder.drop()


@shared_task(bind=True, base=WarmTask, name=PLOT_TASK)
def plot_notified_job(task: WarmTask) -> None:
    """Draw the plots that have been due the longest."""
    from service.queue.grading_job import plot_next_job

    child = task.child
    try:
        plot_next_job(child.store, child.settings)
    except Exception:
        # The row still marks them as due, so they are retried a limited number of times.
        _log.exception("plots.failed")


@shared_task(bind=True, base=WarmTask, name=EXPLAIN_TASK)
def explain_notified_grade(task: WarmTask) -> None:
    """Search the causes of the lost marks of the next grade."""
    from service.queue.explaining_job import explain_next_grade

    child = task.child
    with child.self_tester.busy():
        try:
            explain_next_grade(child.store, child.settings, child.runner)
        except Exception:
            # Grades that no one has claimed are notified again.
            _log.exception("causes.failed")


@signals.setup_logging.connect
def _configure_worker_logging(**_: object) -> None:
    configure_logging(load_settings().log_level)


@signals.worker_process_init.connect
def _prepare_pool_child(**_: object) -> None:
    # If memory runs out, a pool child is killed before its parent, and student code before both.
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("300")
    # Imports create little garbage, and collecting it would take a tenth of their time.
    gc.disable()
    # An exception here would end the pool child and each successor; an exception in a task is stored.
    try:
        child = _child_holder.child
        # Otherwise the first job would wait for it.
        from service.queue import grading_job  # noqa: F401

        child.runner.check_sandbox()
        child.self_tester.begin()
        child.self_tester.repeat_in_thread()
    except Exception:
        _log.exception("pool_child.cold")
    finally:
        gc.freeze()
        gc.enable()


@signals.worker_process_shutdown.connect
def _exit_pool_child(exitcode: int, **_: object) -> None:
    _child_holder.drop()
    # Celery would sleep for a second before its parent, which only waits for the end, kills it.
    os._exit(exitcode)
