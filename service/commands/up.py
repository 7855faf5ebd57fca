"""``robomark up`` and ``robomark serve``: their options. ``service_startup.py`` does the work."""

from __future__ import annotations

from typing import Annotated

import typer

Host = Annotated[
    str,
    typer.Option(
        help="The address of the web server. The default accepts connections from this machine only. For other "
        "machines, set ROBOMARK_PUBLIC_URL."
    ),
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="The port. 0 selects a free port.")]


def up(
    workers: Annotated[
        int,
        typer.Option(min=1, max=64, help="Number of workers. Each grades ROBOMARK_CONCURRENCY submissions at a time."),
    ] = 1,
    serve: Annotated[bool, typer.Option("--serve/--no-serve", help="Also start the web server.")] = True,
    host: Host = "127.0.0.1",
    port: Port = 8470,
) -> None:
    """Start broker, workers and web server, and keep them running until Ctrl-C. Unfinished jobs return to the queue."""
    from service.commands.service_startup import run_service

    run_service(workers, host, port, serve=serve)


def serve(host: Host = "127.0.0.1", port: Port = 8470) -> None:
    """Answer on the web: pages, the API, /health/live, /health/ready and /metrics. Grades nothing; workers do."""
    from service.commands.service_startup import run_web_server

    run_web_server(host, port)
