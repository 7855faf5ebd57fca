"""One student's data, on request: all of it as a zip, or all of it removed."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends
from fastapi.responses import Response

from service.store.purge import erase_student
from service.store.states import Role
from service.student_export import export_student
from service.web.access import RowNumber, enrolment_in, member_in
from service.web.api.grades import ZIP
from service.web.api.shapes import Shape, like
from service.web.api_access import CallerInCourse, in_course
from service.web.api_routes import api_router
from service.web.context import Context

router = api_router("privacy")
Manages = Annotated[CallerInCourse, Depends(in_course(Role.INSTRUCTOR, "manage"))]
Reads = Annotated[CallerInCourse, Depends(in_course(Role.STUDENT, "read"))]


class ErasedShape(Shape):
    """How much was removed."""

    submissions: int
    grades: int

    model_config = like(submissions=4, grades=5)


@router.get("/courses/{course_id}/mine/data", responses=ZIP, response_class=Response)
def own_data(here: Reads, context: Context) -> Response:
    """All there is of the token's owner in the course, as they may see it: a zip of JSON, submissions and reports."""
    with context.store.reading() as session:
        enrolment_id = enrolment_in(session, here.caller.identity, here.course_id).id
    return _zip(export_student(context.store, enrolment_id), enrolment_id)


@router.get("/courses/{course_id}/people/{enrolment_id}/data", responses=ZIP, response_class=Response)
def data(here: Manages, context: Context, enrolment_id: RowNumber) -> Response:
    """All there is of a student of the course, as they may see it, to be given to them."""
    with context.store.reading() as session:
        member_in(session, here.course_id, enrolment_id, Role.STUDENT)
    return _zip(export_student(context.store, enrolment_id), enrolment_id)


@router.delete("/courses/{course_id}/people/{student_id}")
def erase(here: Manages, context: Context, student_id: RowNumber) -> ErasedShape:
    """Remove a student of the course for good: submissions, grades, recordings, and who they are."""
    with context.store.reading() as session:
        member_in(session, here.course_id, student_id, Role.STUDENT)
    return ErasedShape.model_validate(erase_student(context.store, student_id, here.actor))


def _zip(data: bytes, enrolment_id: int) -> Response:
    headers = {"content-disposition": f'attachment; filename="student-{enrolment_id}.zip"'}
    return Response(data, media_type="application/zip", headers=headers)
