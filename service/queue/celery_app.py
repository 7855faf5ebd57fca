"""Celery, set up so that a lost, doubled or late message does no harm: the database row is the job.

Makes an app from settings; tasks are in ``tasks.py``, and nothing here connects to anything.
"""

from __future__ import annotations

from celery import Celery
from kombu import Exchange, Queue

from service.settings import Settings
from service.store.states import Lane

TRYOUTS = "tryouts"
PLOTS = "plots"
#: In the order in which a worker empties them: whoever tries a program waits for it, and is bounded in how often.
QUEUES = (Lane.INTERACTIVE.value, TRYOUTS, Lane.BATCH.value, PLOTS)
GRADE_TASK = "robomark.grade"
TRYOUT_TASK = "robomark.try"
PLOT_TASK = "robomark.plot"

#: The key under which the worker's command line tells its pool children that they are to do without the sandbox; no
#: setting, variable or task can.
NO_SANDBOX = "robomark_no_sandbox"

#: So long after a job may take no longer, an exception is raised in what still runs, and its process is killed. The
#: sandbox and the lease end everything earlier; this frees a process that hangs all the same.
GRACE_SECONDS = (30, 60)

#: A pool child is replaced when it has grown so far (KiB); one with its zygotes' parents is far below.
_CHILD_KIB = 1_000_000


def make_celery(settings: Settings) -> Celery:
    """A Celery app for this broker. ``settings.broker_url`` must name one."""
    app = Celery("robomark", broker=settings.broker_url, include=["service.queue.tasks"], set_as_current=False)
    exchange = Exchange("robomark", type="direct")
    soft, hard = (settings.job_seconds + more for more in GRACE_SECONDS)
    app.conf.update(
        task_ignore_result=True,
        task_serializer="json",
        accept_content=["json"],
        task_queues=[Queue(name, exchange, routing_key=name) for name in QUEUES],
        task_default_queue=Lane.BATCH.value,
        task_default_exchange=exchange.name,
        task_default_routing_key=Lane.BATCH.value,
        task_create_missing_queues=False,
        task_acks_late=True,
        worker_prefetch_multiplier=1,
        # The lease and the sweeper retry, bounded by the job's attempts; the broker would do it for ever.
        task_reject_on_worker_lost=False,
        task_retry_on_worker_lost=False,
        task_acks_on_failure=True,
        task_acks_on_timeout=True,
        task_soft_time_limit=soft,
        task_time_limit=hard,
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
            "visibility_timeout": 2 * hard,
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
