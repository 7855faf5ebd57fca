"""API of one student's data: download all of it as a zip, or delete it."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends
from fastapi.responses import Response

from service.operations import privacy
from service.operations.privacy import StudentData
from service.operations.types import Role
from service.web.access import RowNumber
from service.web.api.grades import ZIP_RESPONSES
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import api_router
from service.web.attachments import respond_with_attachment
from service.web.context import EXPORT_IN_PROGRESS, Context, hold_slot

router = api_router("privacy")
ManageAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "manage"))]
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.STUDENT, "read"))]


class ErasedShape(Shape):
    """Numbers of removed submissions and grades."""

    submissions: int
    grades: int

    model_config = build_example_config(submissions=4, grades=5)


@router.get("/courses/{course_id}/mine/data", responses=ZIP_RESPONSES, response_class=Response)
def own_data(access: ReadAccess, context: Context) -> Response:
    """Return the data of the token's owner in the course, as a zip of JSON, submissions and reports.

    Contains only the parts that the owner can see as a student.
    """
    context.limits.exports.spend(str(access.actor.person_id))
    with hold_slot(context.exporting, EXPORT_IN_PROGRESS):
        return _respond_with_zip(privacy.export_own(context.service, access.actor, access.course_id))


@router.get("/courses/{course_id}/people/{enrolment_id}/data", responses=ZIP_RESPONSES, response_class=Response)
def data(access: ManageAccess, context: Context, enrolment_id: RowNumber) -> Response:
    """Return the data of a student of the course, as visible to the student.

    Assignments with hidden names are omitted.
    """
    with hold_slot(context.exporting, EXPORT_IN_PROGRESS):
        return _respond_with_zip(privacy.export_student(context.service, access.actor, access.course_id, enrolment_id))


@router.delete("/courses/{course_id}/people/{student_id}")
def erase(access: ManageAccess, context: Context, student_id: RowNumber) -> ErasedShape:
    """Permanently delete a student's submissions, grades, recordings and personal data from the course."""
    return ErasedShape.model_validate(
        privacy.erase_student(context.service, access.actor, access.course_id, student_id)
    )


def _respond_with_zip(data: StudentData) -> Response:
    return respond_with_attachment(data.zip, f"student-{data.enrolment_id}.zip", "application/zip")
