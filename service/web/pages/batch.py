"""One batch for its instructors: how far it is, its table, what came of it, what a regrade changes, and what is done.

Each thing that is done to a batch is a command's too, by the same function of the store.
"""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from typing import Annotated, Any

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.language import translatable
from service.reports.formats import FORMATS
from service.reports.words import verdict_words
from service.store import audit
from service.store.batches import batch_table, batches, publishing, regrades
from service.store.batches.batch_table import SORTS, STATES, TableAsked, TableLine
from service.store.batches.batches import BatchLine
from service.store.batches.overview import PASS_SHARE, missing, overview
from service.store.courses.hidden_names import hidden_names
from service.store.installation import secret_of
from service.store.queue import batch_control, metrics
from service.store.states import BatchState, JobState, Lane
from service.web.access import InCourse, Instructing, RowName, batch_in
from service.web.batch_uploads import assignment_of
from service.web.context import Context, WebContext
from service.web.language import language_of
from service.web.rendering import page
from sim.recording import Verdict

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
_STATES = {
    "queued": translatable("waits"),
    "running": translatable("is being graded"),
    "done": translatable("graded"),
    "dead": translatable("could not be graded"),
    "cancelled": translatable("cancelled"),
    "refused": translatable("refused"),
}
_COLUMNS = {
    "student": translatable("Student"),
    "name": translatable("Name"),
    "assignment": translatable("Assignment"),
    "marks": translatable("Marks"),
    "state": translatable("State"),
    "seconds": translatable("Seconds"),
}
#: What somebody did, by the word for it in the audit.
_ACTIONS = {
    "submit": translatable("submitted"),
    "pause": translatable("paused"),
    "resume": translatable("let it go on"),
    "cancel": translatable("cancelled"),
    "retry": translatable("queued again what could not be graded"),
    "publish": translatable("published"),
    "regrade": translatable("graded it again"),
}


@router.get("")
def submissions(
    request: Request,
    here: Instructing,
    context: Context,
    batch_id: RowName,
    state: Annotated[str, Query(max_length=20)] = "",
    q: Annotated[str, Query(max_length=100)] = "",
    sort: Annotated[str, Query(max_length=20)] = "student",
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
    done: Annotated[str, Query(max_length=20)] = "",
) -> Response:
    """The submissions of a batch: sorted, filtered, searched, in pages."""
    column = sort.removeprefix("-")
    asked = TableAsked(
        state if state in STATES else "", q, column if column in SORTS else "student", sort.startswith("-"), number
    )
    shown = _batch(here, context, batch_id)
    lines: list[TableLine] = shown["lines"]
    with context.store.reading() as session:
        table = batch_table.table_page(lines, asked)
        remarked = batch_table.remarked(session, table.lines)
    return page(
        request,
        here.reader,
        "batch_table.html",
        **shown,
        table=table,
        asked=asked,
        remarked=remarked,
        columns=_columns(lines),
        verdicts={each.value: verdict_words(each, language_of(request)).short for each in Verdict},
        entry=next((each for each in shown["history"] if each.action == done in _ACTIONS), None),
        formats=sorted(name for name, each in FORMATS.items() if each.filled_in is None),
    )


@router.get("/progress")
def progress(request: Request, here: Instructing, context: Context, batch_id: RowName) -> Response:
    """How far a batch is: the part of its pages that is asked for again and again, until there is no more to come."""
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
    far = _far(here, context, batch_id)
    answer = page(request, here.reader, "batch_progress.html", **far)
    if not far["goes_on"]:
        answer.headers["hx-refresh"] = "true"
    return answer


@router.get("/overview")
def show_overview(
    request: Request,
    here: Instructing,
    context: Context,
    batch_id: RowName,
    at_least: Annotated[int, Query(alias="pass", ge=0, le=100)] = int(PASS_SHARE * 100),
) -> Response:
    """What came of a batch: marks, criteria, causes, who is missing, and whom to look at."""
    shown = _batch(here, context, batch_id)
    lines: list[TableLine] = shown["lines"]
    with context.store.reading() as session:
        classes = overview(session, here.course_id, lines, Decimal(at_least) / 100)
        asked = shown["batch"].web_assignment if not classes else None
        nobody = missing(session, here.course_id, asked) if asked else ()
    return page(
        request,
        here.reader,
        "batch_overview.html",
        **shown,
        classes=classes,
        missing=nobody,
        at_least=at_least,
        by_id={line.id: line for line in lines if line.id},
        job_of={(line.assignment, line.student): line.id for line in lines if line.id},
        refused=[line for line in lines if not line.id],
    )


@router.get("/changes")
def show_changes(
    request: Request,
    here: Instructing,
    context: Context,
    batch_id: RowName,
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
) -> Response:
    """What a regrade changes, and why."""
    shown = _batch(here, context, batch_id)
    with context.store.reading() as session:
        found = regrades.changes_page(session, batch_id, number)
    called = {line.id: line.student for line in shown["lines"]}
    told = [replace(each, student=called.get(each.job_id, each.job_id)) for each in found.changes]
    return page(request, here.reader, "batch_changes.html", **shown, found=found, changes=told)


@router.post("/pause")
def pause(here: Instructing, context: Context, batch_id: RowName) -> Response:
    """Begin no more of a batch."""
    _look_for(here, context, batch_id)
    batch_control.pause(context.store, batch_id, actor=here.actor)
    return _back(here, batch_id, "pause")


@router.post("/resume")
def resume(here: Instructing, context: Context, batch_id: RowName) -> Response:
    """Let a paused batch go on."""
    _look_for(here, context, batch_id)
    held = batch_control.resume(context.store, batch_id, actor=here.actor)
    context.notifier.grade(Lane.BATCH, held.waiting)
    return _back(here, batch_id, "resume")


@router.post("/cancel")
def cancel(here: Instructing, context: Context, batch_id: RowName) -> Response:
    """End what of a batch is not graded yet."""
    _look_for(here, context, batch_id)
    batch_control.cancel(context.store, batch_id, actor=here.actor)
    return _back(here, batch_id, "cancel")


@router.post("/retry")
def retry(here: Instructing, context: Context, batch_id: RowName) -> Response:
    """Queue again what of a batch could not be graded."""
    _look_for(here, context, batch_id)
    retried = batch_control.retry(context.store, batch_id, actor=here.actor)
    context.notifier.grade(Lane.BATCH, retried.queued)
    return _back(here, batch_id, "retry")


@router.get("/publish")
def before_publishing(request: Request, here: Instructing, context: Context, batch_id: RowName) -> Response:
    """What publishing would release to how many, and what it would hold back."""
    shown = _batch(here, context, batch_id)
    with context.store.reading() as session:
        publication = publishing.would_publish(session, batch_id)
    return page(request, here.reader, "batch_publish.html", **shown, publication=publication)


@router.post("/publish")
def publish(
    here: Instructing, context: Context, batch_id: RowName, anyway: Annotated[bool, Form()] = False
) -> Response:
    """Let the newest grades of a batch stand, and release them to the students."""
    _look_for(here, context, batch_id)
    publishing.publish(context.store, batch_id, actor=here.actor, anyway=anyway)
    return _back(here, batch_id, "publish")


@router.post("/regrade")
def regrade(
    here: Instructing,
    context: Context,
    batch_id: RowName,
    assignment: Annotated[str, Form(max_length=100)] = "",
) -> Response:
    """Grade a batch again, against an assignment as the course has it now or as each was graded before."""
    _look_for(here, context, batch_id)
    with context.store.reading() as session:
        changed = assignment_of(session, here.course_id, assignment) if assignment else None
    made = regrades.regrade(
        context.store, batch_id, changed, max_attempts=context.settings.max_attempts, actor=here.actor
    )
    context.notifier.grade(Lane.BATCH, made.jobs)
    return RedirectResponse(f"/courses/{here.course_id}/batches/{made.batch_id}/changes", 303)


def _look_for(here: InCourse, context: WebContext, batch_id: str) -> None:
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)


def _back(here: InCourse, batch_id: str, done: str) -> Response:
    return RedirectResponse(f"/courses/{here.course_id}/batches/{batch_id}?done={done}", 303)


def _batch(here: InCourse, context: WebContext, batch_id: str) -> dict[str, Any]:
    """What all pages of a batch show."""
    secret = secret_of(context.store)
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
        line = batches.batch(session, batch_id)
        hidden = hidden_names(session, here.course_id, secret)
        lines = batch_table.table_lines(session, batch_id, line.refusals, hidden)
        waiting = 0 if line.regrade_of is not None else publishing.unpublished_regrades(session, batch_id)
        history = audit.entries(session, "batch", batch_id)
    graded = [each for each in lines if each.state == JobState.DONE and each.staff_only is None]
    return {
        "lines": lines,
        "assignments": sorted({each.assignment for each in lines if each.id}),
        "nameless": bool(hidden.assignments & {each.assignment for each in lines}),
        "waiting_regrades": waiting,
        "history": list(reversed(history)),
        "to_publish": sum(each.published_at is None and each.suspect is None for each in graded),
        "actions": _ACTIONS,
        **_far(here, context, batch_id),
    }


def _counts(line: BatchLine) -> dict[str, int]:
    counts = {state.value: line.states.get(state, 0) for state in JobState} | {batch_table.REFUSED: len(line.refusals)}
    return {state: count for state, count in counts.items() if count}


def _far(here: InCourse, context: WebContext, batch_id: str) -> dict[str, Any]:
    with context.store.reading() as session:
        line = batches.batch(session, batch_id)
        far = batches.progress(session, batch_id)
        pace = metrics.pace(session, batch_id)
    return {
        "here": here,
        "batch": line,
        "far": far,
        "share": round(100 * min(1.0, (far.ended + far.partial) / far.jobs)) if far.jobs else 100,
        "pace": pace,
        "goes_on": far.ended < far.jobs,
        "path": f"/courses/{here.course_id}/batches/{batch_id}",
        "counts": _counts(line),
        "states": _STATES,
        "BatchState": BatchState,
    }


def _columns(lines: list[TableLine]) -> dict[str, str]:
    """The columns that tell something of this batch, by what they are sorted by."""
    several = len({line.assignment for line in lines}) > 1
    named = any(line.name not in ("", line.student) for line in lines)
    dropped = ({"assignment"} if not several else set()) | ({"name"} if not named else set())
    return {key: title for key, title in _COLUMNS.items() if key not in dropped}
