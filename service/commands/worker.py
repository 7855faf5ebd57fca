"""``robomark worker``: grade queued jobs. ``queue/worker.py`` implements the worker."""

from __future__ import annotations

from typing import Annotated

import typer

from sim.errors import HostError


def worker(
    unsafe: Annotated[
        bool, typer.Option("--unsafe-no-sandbox", help="Run submissions without a sandbox. For development only.")
    ] = False,
) -> None:
    """Start a worker, which grades queued jobs. Starts the bundled broker if no other is configured or running."""
    from responders.sandbox import control_group
    from service.commands.output import warn_about_missing_sandbox
    from service.queue.broker import EmbeddedBroker
    from service.queue.logs import configure_logging
    from service.queue.worker import run_worker
    from service.settings import load_settings

    settings = load_settings()
    configure_logging(settings.log_level)
    if unsafe:
        warn_about_missing_sandbox()
    if settings.broker_url:
        status = run_worker(settings, is_unsafe=unsafe)
    else:
        # Divide the control group before the broker starts: this is only possible while no other process is in it.
        control_group.divide_group()
        with EmbeddedBroker(settings) as broker:
            status = run_worker(broker.settings, is_unsafe=unsafe)
    if status:
        raise HostError(f"the worker stopped with status {status}; see its log")
