"""One submission of a student's own: where it is in the queue, its report as it comes, the attempts beside it.

A second look at it is asked for elsewhere; what of a grade is shown is ``reports/view.py``'s.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select

from service import own_work
from service.report_files import report_body
from service.reports.view import student_view
from service.store.batches import batches
from service.store.courses import open_assignments, policies
from service.store.grades import appeals, results
from service.store.models import SubmissionRow
from service.store.queue.queue_places import queue_place
from service.web.access import RowNumber, Studying, enrolment_in, nothing_here
from service.web.attachments import attachment
from service.web.context import Context
from service.web.language import language_of
from service.web.pages.mine import curve
from service.web.rendering import page, wants_part

router = APIRouter()


@router.get("/courses/{course_id}/mine/submissions/{submission_id}")
def own_submission(request: Request, here: Studying, context: Context, submission_id: RowNumber) -> Response:
    """How far it is, or its report; htmx is given how far it is alone, and told to load the page when that is over."""
    with context.store.reading() as session:
        enrolment_id = enrolment_in(session, here.reader.identity, here.course_id).id
        found = own_work.own_submission(session, enrolment_id, submission_id)
        if found is None:
            raise nothing_here()
        place = queue_place(session, found.job_id) if found.waits else None
        if wants_part(request):
            if place is None:
                return Response(headers={"hx-refresh": "true"})
            return page(request, here.reader, "own_progress.html", here=here, found=found, place=place)
        attempts = own_work.own_submissions(session, enrolment_id, found.assignment)
        counting = own_work.counting_submission(session, enrolment_id, found.assignment)
        allowance = own_work.allowance(session, enrolment_id, found.assignment)
        prepared = open_assignments.of_course(session, here.course_id)
        asked = appeals.of_submission(session, submission_id)
        view = line = None
        if found.shown:
            line = batches.job_line(session, found.job_id)
            released = policies.released(session, found.job_id)
            view = student_view(results.load(session, found.job_id), released, language_of(request))
    return page(
        request,
        here.reader,
        "own_submission.html",
        here=here,
        found=found,
        place=place,
        attempts=attempts,
        counting=counting,
        is_open=any(each.assignment == found.assignment and each.open for each in prepared),
        curve=curve(attempts),
        allowance=allowance,
        appeals=asked,
        report=report_body(context.store, line, view) if line and view else None,
    )


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/files")
def own_files(here: Studying, context: Context, submission_id: RowNumber) -> Response:
    """What was submitted, as a .zip that can be submitted again."""
    with context.store.reading() as session:
        enrolment_id = enrolment_in(session, here.reader.identity, here.course_id).id
        mine = (SubmissionRow.id == submission_id, SubmissionRow.enrolment_id == enrolment_id)
        kept = session.execute(
            select(SubmissionRow.packed, SubmissionRow.assignment, SubmissionRow.attempt).where(*mine)
        ).one_or_none()
    if kept is None:
        raise nothing_here()
    packed, assignment, attempt = kept
    return attachment(packed, f"{assignment}-{attempt}.zip", "application/zip")
