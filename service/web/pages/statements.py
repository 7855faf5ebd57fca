"""Downloads of receipts and statements, and the page with the keys that sign them."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.operations import statements
from service.statements.keys import dump_keys
from service.web.access import CourseInstructor, CourseStudent, OptionalReader, RowName, RowNumber
from service.web.attachments import respond_with_attachment
from service.web.context import Context
from service.web.rendering import render_page

router = APIRouter()


@router.get("/statement-keys")
def show_keys(request: Request, reader: OptionalReader, context: Context) -> Response:
    """Show the public keys. They are the same for everybody, and needed by people without an account."""
    return render_page(request, reader, "statement_keys.html", keys=statements.list_keys(context.service))


@router.get("/statement-keys.json")
def download_keys(context: Context) -> Response:
    """Return the public keys as the file that ``robomark verify --keys`` reads."""
    content = dump_keys(statements.list_keys(context.service))
    return respond_with_attachment(content, "statement-keys.json", "application/json")


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/receipt")
def download_own_receipt(access: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Return the signed receipt of a submission."""
    context.limits.statements.spend(str(access.actor.person_id))
    receipt = statements.show_own_receipt(context.service, access.actor, access.course_id, submission_id)
    return respond_with_attachment(receipt.data, receipt.name, "application/json")


@router.get("/courses/{course_id}/mine/submissions/{submission_id}/statement")
def download_own_statement(access: CourseStudent, context: Context, submission_id: RowNumber) -> Response:
    """Return the signed statement on a published grade, with what the student may see."""
    context.limits.statements.spend(str(access.actor.person_id))
    statement = statements.show_own_statement(context.service, access.actor, access.course_id, submission_id)
    return respond_with_attachment(statement.data, statement.name, "application/json")


@router.get("/courses/{course_id}/grades/{job_id}/statement")
def download_statement(access: CourseInstructor, context: Context, job_id: RowName) -> Response:
    """Return the signed statement on a published grade, with all facts and seeds."""
    statement = statements.show_statement(context.service, access.actor, access.course_id, job_id)
    return respond_with_attachment(statement.data, statement.name, "application/json")
