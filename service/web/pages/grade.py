"""One grade for staff: the report with every trial, links to neighbouring grades, publishing and regrading.

``service.reports`` writes the report. ``marking.py`` contains the page for adjusting marks.
"""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.operations import grade_views, regrades
from service.web.access import CourseInstructor, RowName
from service.web.context import Context
from service.web.language import detect_language
from service.web.rendering import is_htmx_request, render_page

router = APIRouter(prefix="/courses/{course_id}/grades/{job_id}")


@router.get("")
def show_grade(
    request: Request, access: CourseInstructor, context: Context, job_id: RowName, done: str = ""
) -> Response:
    """Show the report of one submission, or the progress while it is being graded."""
    grade_key = (context.service, access.actor, access.course_id, job_id)
    if is_htmx_request(request) and grade_views.show_state(*grade_key).ended:
        return Response(headers={"hx-refresh": "true"})
    view = grade_views.show_grade(*grade_key, detect_language(request))
    newest_first = list(reversed(view.history))
    return render_page(
        request,
        access.reader,
        "grade.html",
        access=access,
        line=view.line,
        path=f"/courses/{access.course_id}/grades/{job_id}",
        report=view.report,
        change=view.change,
        stage_labels=regrades.STAGE_LABELS,
        part_labels=regrades.PART_LABELS,
        gradings=view.gradings,
        attempts=view.attempts,
        history=newest_first,
        neighbours=view.neighbours,
        batch_id=view.batch_id,
        awaits_approval=view.awaits_approval,
        publication=next((entry for entry in newest_first if entry.action == done == "publish"), None),
    )


@router.get("/as-student")
def show_as_student(request: Request, access: CourseInstructor, context: Context, job_id: RowName) -> Response:
    """Show the report that the student sees when the grade is published."""
    language = detect_language(request)
    student_report = grade_views.show_student_report(context.service, access.actor, access.course_id, job_id, language)
    return render_page(
        request,
        access.reader,
        "grade_as_student.html",
        access=access,
        line=student_report.line,
        path=f"/courses/{access.course_id}/grades/{job_id}",
        report=student_report.report,
    )


@router.post("/publish")
def publish(
    access: CourseInstructor, context: Context, job_id: RowName, anyway: Annotated[bool, Form()] = False
) -> Response:
    """Make the newest grade of this submission the current grade, and release it to the student."""
    regrades.publish_one(context.service, access.actor, access.course_id, job_id, includes_held_back=anyway)
    return RedirectResponse(f"/courses/{access.course_id}/grades/{job_id}?done=publish", 303)


@router.post("/regrade")
def regrade(
    access: CourseInstructor, context: Context, job_id: RowName, assignment: Annotated[str, Form(max_length=100)] = ""
) -> Response:
    """Regrade this submission, against the assignment's current version or the one used before."""
    new_job_id = regrades.regrade_one(context.service, access.actor, access.course_id, job_id, assignment)
    return RedirectResponse(f"/courses/{access.course_id}/grades/{new_job_id}", 303)


@router.post("/grade-over-limit")
def grade_over_limit(access: CourseInstructor, context: Context, job_id: RowName) -> Response:
    """Grade a submission that was not graded because it exceeds a limit."""
    regrades.grade_over_limit(context.service, access.actor, access.course_id, job_id)
    return RedirectResponse(f"/courses/{access.course_id}/grades/{job_id}", 303)
