"""One grade for staff: its report with every trial, the one before and the one after, publishing and grading it again.

What a report says is ``service.reports``'; what is set by hand has pages of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.report_files import report_body
from service.reports.html import ReportParts
from service.reports.view import staff_view
from service.store import audit
from service.store.batches import batches, publishing, regrades
from service.store.courses.hidden_names import hidden_names_of
from service.store.grades import own_gradings, results
from service.store.states import JobState, Lane
from service.web.access import InCourse, Instructing, RowName, job_in
from service.web.batch_uploads import assignment_of
from service.web.context import Context, WebContext
from service.web.language import language_of
from service.web.neighbours import neighbours
from service.web.rendering import page, wants_part

router = APIRouter(prefix="/courses/{course_id}/grades/{job_id}")


@router.get("")
def grade(request: Request, here: Instructing, context: Context, job_id: RowName, done: str = "") -> Response:
    """The report of one submission; while it is graded, how far that is."""
    hidden = hidden_names_of(context.store, here.course_id)
    with context.store.reading() as session:
        row = job_in(session, here.course_id, job_id)
        whole = batches.job_line(session, job_id)
        line = whole.hidden_by(hidden)
        change = regrades.change(session, job_id)
        gradings = regrades.gradings(session, row.submission_id)
        attempts = own_gradings.newest(session, row.enrolment_id, line.assignment)
        graded = results.load(session, job_id) if line.state is JobState.DONE else None
        history = audit.entries(session, "job", job_id)
    if wants_part(request) and line.ended:
        return Response(headers={"hx-refresh": "true"})
    report: ReportParts | None = None
    if graded is not None:
        view = staff_view(replace(graded, student=line.student), language_of(request))
        report = report_body(context.store, whole, view)
    return page(
        request,
        here.reader,
        "grade.html",
        here=here,
        line=line,
        path=f"/courses/{here.course_id}/grades/{job_id}",
        report=report,
        change=change,
        gradings=gradings,
        attempts=attempts,
        history=list(reversed(history)),
        beside=neighbours(context.store, row, hidden),
        batch_id=row.batch_id,
        told=next((entry for entry in reversed(history) if entry.action == done == "publish"), None),
    )


@router.post("/publish")
def publish(here: Instructing, context: Context, job_id: RowName, anyway: Annotated[bool, Form()] = False) -> Response:
    """Let the newest grade of this submission stand, and release it to its student."""
    _look_for(here, context, job_id)
    publishing.publish_one(context.store, job_id, actor=here.actor, anyway=anyway)
    return RedirectResponse(f"/courses/{here.course_id}/grades/{job_id}?done=publish", 303)


@router.post("/regrade")
def regrade(
    here: Instructing, context: Context, job_id: RowName, assignment: Annotated[str, Form(max_length=100)] = ""
) -> Response:
    """Grade this submission again, against the assignment as it is now or as it was."""
    _look_for(here, context, job_id)
    with context.store.reading() as session:
        changed = assignment_of(session, here.course_id, assignment) if assignment else None
    most = context.settings.max_attempts
    made = regrades.regrade_one(context.store, job_id, changed, max_attempts=most, actor=here.actor)
    context.notifier.grade(Lane.INTERACTIVE)
    return RedirectResponse(f"/courses/{here.course_id}/grades/{made}", 303)


def _look_for(here: InCourse, context: WebContext, job_id: str) -> None:
    with context.store.reading() as session:
        job_in(session, here.course_id, job_id)
