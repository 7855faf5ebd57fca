"""Logging of services, with the job's id if there is one: readable text on a terminal, otherwise JSON.

Commands that people run print instead of logging.
"""

from __future__ import annotations

import json
import logging
import os
import sys
from datetime import UTC, datetime

import structlog
from structlog.typing import Processor


def configure_logging(level: str) -> None:
    """Log everything from ``level`` on to standard error, as text or as one JSON object per line."""
    number = logging.getLevelNamesMapping()[level]
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *_build_renderers()],
        )
    )
    logging.basicConfig(level=number, handlers=[handler], force=True)
    logging.captureWarnings(True)
    # Messages of Celery's pool about its processes go to no other logger's handlers.
    logging.getLogger("multiprocessing").handlers = [handler]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )


def print_event(event: str, sentence: str) -> None:
    """Print a message of a service to standard output: a sentence on a terminal, otherwise a JSON object."""
    if sys.stdout.isatty():
        print(sentence, flush=True)
    else:
        fields = {"event": event, "message": sentence, "timestamp": datetime.now(UTC).isoformat()}
        print(json.dumps(fields), flush=True)


def _build_renderers() -> list[Processor]:
    if sys.stderr.isatty():
        # The default formatter for traces also prints local variables, among them secrets and students' files.
        plain = structlog.dev.plain_traceback
        return [structlog.dev.ConsoleRenderer(colors="NO_COLOR" not in os.environ, exception_formatter=plain)]
    return [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
