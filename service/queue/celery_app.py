"""Celery app with settings for which lost, duplicate or late messages are harmless: the database row is the job.

Creates an app from settings without connecting; ``tasks.py`` contains the tasks.
"""

from __future__ import annotations

from celery import Celery
from kombu import Exchange, Queue

from service.settings import Settings
from service.store.states import JobQueue

TEST_RUNS = "tryouts"
PLOTS = "plots"
CAUSES = "causes"
#: In order of priority for a worker. Students wait for test runs, whose number is limited.
QUEUES = (JobQueue.INTERACTIVE.value, TEST_RUNS, JobQueue.BATCH.value, PLOTS, JobQueue.COMPLETION.value, CAUSES)
GRADE_TASK = "robomark.grade"
TEST_RUN_TASK = "robomark.try"
PLOT_TASK = "robomark.plot"
EXPLAIN_TASK = "robomark.explain"

#: Key with which the worker's command line disables the sandbox of its pool children. No setting, environment variable
#: or task can set it.
NO_SANDBOX = "robomark_no_sandbox"

#: Seconds after the job limit until an exception is raised in the task, and until its process is killed. The sandbox
#: and the lease end everything earlier; this frees a process that hangs despite them.
GRACE_SECONDS = (30, 60)

#: Memory in KiB above which a pool child is replaced; a child with its zygotes' parents is far below.
_CHILD_KIB = 1_000_000


def make_celery(settings: Settings) -> Celery:
    """Create a Celery app for this broker. ``settings.broker_url`` must be set."""
    app = Celery("robomark", broker=settings.broker_url, include=["service.queue.tasks"], set_as_current=False)
    exchange = Exchange("robomark", type="direct")
    soft_limit, hard_limit = (settings.job_seconds + more for more in GRACE_SECONDS)
    app.conf.update(
        task_ignore_result=True,
        task_serializer="json",
        accept_content=["json"],
        task_queues=[Queue(name, exchange, routing_key=name) for name in QUEUES],
        task_default_queue=JobQueue.BATCH.value,
        task_default_exchange=exchange.name,
        task_default_routing_key=JobQueue.BATCH.value,
        task_create_missing_queues=False,
        task_acks_late=True,
        worker_prefetch_multiplier=1,
        # The lease and the sweeper retry, limited by the job's attempts; the broker would retry forever.
        task_reject_on_worker_lost=False,
        task_retry_on_worker_lost=False,
        task_acks_on_failure=True,
        task_acks_on_timeout=True,
        task_soft_time_limit=soft_limit,
        task_time_limit=hard_limit,
        task_publish_retry=True,
        task_publish_retry_policy={
            "max_retries": 2,
            "interval_start": 0,
            "interval_step": 0.2,
            "interval_max": 0.5,
        },
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_channel_error_retry=True,
        broker_transport_options={
            "visibility_timeout": 2 * hard_limit,
            "unacked_restore_interval": 10,
            "unacked_restore_throttle": 1,
            "queue_order_strategy": "priority",
            "socket_timeout": 10,
            "socket_connect_timeout": 3,
            "socket_keepalive": True,
            "health_check_interval": 10,
            "global_keyprefix": "robomark:",
        },
        worker_cancel_long_running_tasks_on_connection_loss=False,
        worker_concurrency=settings.concurrency,
        worker_max_tasks_per_child=None,
        worker_max_memory_per_child=_CHILD_KIB,
        worker_pool_start_method="spawn",
        worker_proc_alive_timeout=60,
        worker_soft_shutdown_timeout=20,
        worker_enable_soft_shutdown_on_idle=True,
        worker_send_task_events=False,
        worker_hijack_root_logger=False,
        worker_redirect_stdouts=False,
        worker_enable_remote_control=False,
    )
    return app
