"""One batch for instructors: progress, table, results, changes by a regrade, and actions.

Each action has a command that uses the same operation.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from decimal import Decimal
from typing import Annotated, Any

from fastapi import APIRouter, Form, Query, Request
from fastapi.responses import RedirectResponse, Response

from service.grading.class_statistics import PASS_SHARE
from service.language import translatable
from service.operations import batch_views as views
from service.operations import batches as operations
from service.operations import regrades as regrade_operations
from service.operations.batch_views import (
    REFUSED,
    SORTS,
    STATES,
    BatchLine,
    BatchView,
    TableLine,
    TableRequest,
    TableView,
)
from service.operations.types import BatchState, JobState
from service.reports.formats import FORMATS
from service.reports.verdict_sentences import describe_verdict
from service.web.access import CourseInstructor, ReaderInCourse, RowName
from service.web.context import Context, WebContext
from service.web.language import detect_language
from service.web.rendering import render_page
from sim.recording import Verdict

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
STATE_LABELS = {
    "queued": translatable("queued"),
    "running": translatable("running"),
    "done": translatable("graded"),
    "dead": translatable("failed"),
    "cancelled": translatable("cancelled"),
    "refused": translatable("rejected"),
}
_COLUMNS = {
    "student": translatable("Student"),
    "name": translatable("Name"),
    "assignment": translatable("Assignment"),
    "marks": translatable("Marks"),
    "state": translatable("State"),
    "seconds": translatable("Seconds"),
}
#: Descriptions of actions, by their names in the activity log.
_ACTIONS = {
    "submit": translatable("submitted"),
    "pause": translatable("paused"),
    "resume": translatable("resumed"),
    "cancel": translatable("cancelled"),
    "retry": translatable("retried failed jobs"),
    "publish": translatable("published"),
    "regrade": translatable("regraded"),
}


@router.get("")
def show_submissions(
    request: Request,
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    state: Annotated[str, Query(max_length=20)] = "",
    q: Annotated[str, Query(max_length=100)] = "",
    sort: Annotated[str, Query(max_length=20)] = "student",
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
    done: Annotated[str, Query(max_length=20)] = "",
) -> Response:
    """Show the submissions of a batch. The table can be sorted, filtered, searched and paged."""
    column = sort.removeprefix("-")
    table_request = TableRequest(
        state if state in STATES else "", q, column if column in SORTS else "student", sort.startswith("-"), number
    )
    view, page_context = _load_batch(access, context, batch_id)
    table, review_counts = views.show_table_page(
        context.service, access.actor, access.course_id, view.lines, table_request
    )
    return render_page(
        request,
        access.reader,
        "batch_table.html",
        **page_context,
        table=table,
        table_request=table_request,
        review_counts=review_counts,
        columns=_choose_columns(view.lines),
        verdicts={each.value: describe_verdict(each, detect_language(request)).short for each in Verdict},
        entry=next((each for each in view.history if each.action == done in _ACTIONS), None),
        formats=sorted(name for name, each in FORMATS.items() if each.worksheet is None),
    )


@router.get("/progress")
def show_progress(request: Request, access: CourseInstructor, context: Context, batch_id: RowName) -> Response:
    """Return the part of the page that shows the progress.

    The page requests it repeatedly until the batch is finished.
    """
    progress_context = _build_progress_context(
        access, views.show_progress(context.service, access.actor, access.course_id, batch_id)
    )
    answer = render_page(request, access.reader, "batch_progress.html", **progress_context)
    if not progress_context["is_unfinished"]:
        answer.headers["hx-refresh"] = "true"
    return answer


@router.get("/overview")
def show_overview(
    request: Request,
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    at_least: Annotated[int, Query(alias="pass", ge=0, le=100)] = int(PASS_SHARE * 100),
) -> Response:
    """Show the results of a batch: marks, criteria, causes, students to review and missing students."""
    table_view, page_context = _load_batch(access, context, batch_id)
    overview = views.show_overview_of_table(
        context.service, access.actor, access.course_id, table_view, Decimal(at_least) / 100
    )
    lines = overview.lines
    return render_page(
        request,
        access.reader,
        "batch_overview.html",
        **page_context,
        classes=overview.classes,
        missing=overview.missing,
        at_least=at_least,
        by_id={line.id: line for line in lines if line.id},
        job_of={(line.assignment, line.student): line.id for line in lines if line.id},
        rejected_lines=[line for line in lines if not line.id],
    )


@router.get("/changes")
def show_changes(
    request: Request,
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    number: Annotated[int, Query(alias="page", ge=1, le=10_000)] = 1,
    at_least: Annotated[int, Query(alias="pass", ge=0, le=100)] = int(PASS_SHARE * 100),
) -> Response:
    """Show the changes by a regrade: a summary, then each change with the stages that caused it."""
    _, page_context = _load_batch(access, context, batch_id)
    changes_page = views.show_changes_page(
        context.service, access.actor, access.course_id, batch_id, number, Decimal(at_least) / 100
    )
    return render_page(
        request,
        access.reader,
        "batch_changes.html",
        **page_context,
        changes_page=changes_page,
        changes=changes_page.changes,
        summary=changes_page.summary,
        at_least=at_least,
        stage_labels=regrade_operations.STAGE_LABELS,
        stage_meanings=regrade_operations.STAGE_MEANINGS,
        part_labels=regrade_operations.PART_LABELS,
    )


@router.post("/pause")
def pause(access: CourseInstructor, context: Context, batch_id: RowName) -> Response:
    """Pause a batch."""
    operations.pause(context.service, access.actor, access.course_id, batch_id)
    return _redirect_to_batch(access, batch_id, "pause")


@router.post("/resume")
def resume(access: CourseInstructor, context: Context, batch_id: RowName) -> Response:
    """Resume a paused batch."""
    operations.resume(context.service, access.actor, access.course_id, batch_id)
    return _redirect_to_batch(access, batch_id, "resume")


@router.post("/cancel")
def cancel(access: CourseInstructor, context: Context, batch_id: RowName) -> Response:
    """Cancel the jobs of a batch that are not finished."""
    operations.cancel(context.service, access.actor, access.course_id, batch_id)
    return _redirect_to_batch(access, batch_id, "cancel")


@router.post("/retry")
def retry(access: CourseInstructor, context: Context, batch_id: RowName) -> Response:
    """Requeue the failed jobs of a batch."""
    operations.retry(context.service, access.actor, access.course_id, batch_id)
    return _redirect_to_batch(access, batch_id, "retry")


@router.get("/publish")
def preview_publication(request: Request, access: CourseInstructor, context: Context, batch_id: RowName) -> Response:
    """Show how many grades publishing would release and hold back."""
    _, page_context = _load_batch(access, context, batch_id)
    publication = regrade_operations.preview_publication(context.service, access.actor, access.course_id, batch_id)
    return render_page(
        request,
        access.reader,
        "batch_publish.html",
        **page_context,
        publication=publication,
        completion_time=timedelta(seconds=publication.completion_seconds),
    )


@router.post("/publish")
def publish(
    access: CourseInstructor, context: Context, batch_id: RowName, anyway: Annotated[bool, Form()] = False
) -> Response:
    """Make the newest grades of a batch the current grades, and release them to the students."""
    regrade_operations.publish(context.service, access.actor, access.course_id, batch_id, includes_held_back=anyway)
    return _redirect_to_batch(access, batch_id, "publish")


@router.post("/regrade")
def regrade(
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    assignment: Annotated[str, Form(max_length=100)] = "",
) -> Response:
    """Regrade a batch, against the course's current assignment or the one used before."""
    regrade_batch = regrade_operations.regrade_batch(
        context.service, access.actor, access.course_id, batch_id, assignment
    )
    return RedirectResponse(f"/courses/{access.course_id}/batches/{regrade_batch.batch_id}/changes", 303)


def _redirect_to_batch(access: ReaderInCourse, batch_id: str, action: str) -> Response:
    return RedirectResponse(f"/courses/{access.course_id}/batches/{batch_id}?done={action}", 303)


def _load_batch(access: ReaderInCourse, context: WebContext, batch_id: str) -> tuple[TableView, dict[str, Any]]:
    """Return the table of a batch and the template variables that all its pages need."""
    table_view = views.show_table(context.service, access.actor, access.course_id, batch_id)
    graded_lines = [each for each in table_view.lines if views.is_graded(each)]
    return table_view, {
        "lines": table_view.lines,
        "assignments": sorted({each.assignment for each in table_view.lines if each.id}),
        "has_hidden_names": table_view.has_hidden_names,
        "waiting_regrades": table_view.waiting_regrades,
        "history": table_view.history,
        "to_publish": sum(each.published_at is None for each in graded_lines),
        "actions": _ACTIONS,
        **_build_progress_context(access, table_view.view),
    }


def _count_states(line: BatchLine) -> dict[str, int]:
    counts = {state.value: line.states.get(state, 0) for state in JobState} | {REFUSED: len(line.refusals)}
    return {state: count for state, count in counts.items() if count}


def _build_progress_context(access: ReaderInCourse, view: BatchView) -> dict[str, Any]:
    line, progress = view.batch, view.progress
    return {
        "access": access,
        "batch": line,
        "progress": progress,
        "share": round(100 * min(1.0, (progress.ended + progress.partial) / progress.jobs)) if progress.jobs else 100,
        "pace": view.pace,
        "is_unfinished": progress.ended < progress.jobs,
        "path": f"/courses/{access.course_id}/batches/{line.id}",
        "counts": _count_states(line),
        "states": STATE_LABELS,
        "BatchState": BatchState,
    }


def _choose_columns(lines: Sequence[TableLine]) -> dict[str, str]:
    """Return the titles of the columns with useful data, by sort key."""
    has_assignments = len({line.assignment for line in lines}) > 1
    has_names = any(line.name not in ("", line.student) for line in lines)
    hidden_columns = ({"assignment"} if not has_assignments else set()) | ({"name"} if not has_names else set())
    return {key: title for key, title in _COLUMNS.items() if key not in hidden_columns}
