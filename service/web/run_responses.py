"""Responses of the pages that run programs: the progress of a run, its result, and reasons why it did not start."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from starlette.exceptions import HTTPException

from service.operations.errors import NotFound
from service.operations.test_runs import StudentTestRun
from service.reports.html import render_replay_section
from service.web.access import ReaderInCourse
from service.web.errors import describe_error
from service.web.http_errors import extract_message
from service.web.language import detect_language
from service.web.rendering import is_htmx_request, render_page
from sim.errors import UsageError

_MIN_INTERVAL, _MIN_INTERVAL_OF_LONG_RUNS = timedelta(milliseconds=250), timedelta(seconds=1)
#: About the time that one run takes.
_INTERVAL_PER_RUN = timedelta(milliseconds=200)
_MAX_INTERVAL = timedelta(seconds=10)


@dataclass(frozen=True, slots=True)
class Rejection:
    """The reason why a run did not start, in the reader's language."""

    sentence: str
    status: int
    headers: Mapping[str, str] = field(default_factory=dict)


def find_rejection(request: Request, start: Callable[[], object]) -> Rejection | None:
    """Start a run, and return why it was rejected; None if it was not. Raises NotFound."""
    try:
        start()
    except NotFound:
        raise
    except UsageError as error:
        return Rejection(describe_error(error, detect_language(request)), 422)
    except HTTPException as error:
        if error.status_code != 429:
            raise
        sentence = detect_language(request).translate_sentence(extract_message(error))
        return Rejection(sentence, 429, dict(error.headers or {}))
    return None


def respond_to_start(
    request: Request, access: ReaderInCourse, rejection: Rejection | None, line: StudentTestRun | None
) -> Response:
    """Return the rejection or the progress for htmx; otherwise redirect to the page."""
    if not is_htmx_request(request):
        return RedirectResponse(str(request.url.path), 303)
    if rejection is None:
        return render_progress(request, access, line)
    # htmx shows only successful responses. Others are errors of the server or the network, which the page explains.
    return render_page(request, access.reader, "run_rejection.html", rejection=rejection)


def render_progress(request: Request, access: ReaderInCourse, line: StudentTestRun | None) -> Response:
    """Return the part of a page that asks for the result of a run. If the run is deleted, the page is loaded again."""
    if line is None:
        return Response(headers={"hx-refresh": "true"})
    interval = _compute_interval(line)
    return render_page(request, access.reader, "run_progress.html", access=access, line=line, interval=interval)


def describe_run(
    request: Request, line: StudentTestRun | None, replay: bytes | None, files: Sequence[str], *, has_program: bool
) -> dict[str, object]:
    """Return the variables of a template that shows a run.

    ``files`` are the names of the editors. Errors get links to lines if ``has_program``: the editors hold the program
    of the run.
    """
    return {
        "line": line,
        "replay": render_replay_section(replay, detect_language(request)) if replay else None,
        "interval": _compute_interval(line) if line is not None else 0,
        "files": files,
        "has_program": has_program,
        "is_part": is_htmx_request(request),
    }


def _compute_interval(line: StudentTestRun) -> int:
    """Return the milliseconds until the page asks again: soon for the next runs, later for those far back in the queue.

    Otherwise, the pages of a class that starts its runs at once would keep the server busy.
    """
    waited = datetime.now(UTC) - line.queued_at
    soonest = min(max(waited / 4, _MIN_INTERVAL), _MIN_INTERVAL_OF_LONG_RUNS)
    interval = min(max(line.before * _INTERVAL_PER_RUN, soonest), _MAX_INTERVAL)
    return round(interval / timedelta(milliseconds=1))
