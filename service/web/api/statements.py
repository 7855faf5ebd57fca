"""API for receipts and statements: signed files on submissions and published grades."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends
from fastapi.responses import Response

from service.operations import statements
from service.operations.statements import StatementDownload
from service.operations.types import Role
from service.web.access import RowName, RowNumber
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import ResponseDescriptions, api_router
from service.web.attachments import respond_with_attachment
from service.web.context import Context

router = api_router("statements")
OwnAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "read"))]
StaffAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]
FILE_RESPONSES: ResponseDescriptions = {
    200: {
        "content": {"application/json": {"schema": {"type": "object"}}},
        "description": "The file that `robomark verify` checks.",
    }
}
_OWN_PATH = "/courses/{course_id}/mine/submissions/{submission_id}"


@router.get(_OWN_PATH + "/receipt", responses=FILE_RESPONSES, response_class=Response)
def own_receipt(access: OwnAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the signed receipt of a submission of the token's owner."""
    context.limits.statements.spend(str(access.actor.person_id))
    return _respond(statements.show_own_receipt(context.service, access.actor, access.course_id, submission_id))


@router.get(_OWN_PATH + "/statement", responses=FILE_RESPONSES, response_class=Response)
def own_statement(access: OwnAccess, context: Context, submission_id: RowNumber) -> Response:
    """Return the signed statement on a published grade of the token's owner; 409 before it is published."""
    context.limits.statements.spend(str(access.actor.person_id))
    return _respond(statements.show_own_statement(context.service, access.actor, access.course_id, submission_id))


@router.get("/courses/{course_id}/grades/{job_id}/statement", responses=FILE_RESPONSES, response_class=Response)
def statement(access: StaffAccess, context: Context, job_id: RowName) -> Response:
    """Return the signed statement on a published grade with all facts and seeds; 409 before it is published."""
    return _respond(statements.show_statement(context.service, access.actor, access.course_id, job_id))


def _respond(download: StatementDownload) -> Response:
    return respond_with_attachment(download.data, download.name, "application/json")
