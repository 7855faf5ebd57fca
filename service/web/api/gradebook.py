"""API of the gradebook: the students of a course with their current grades in all its assignments."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated

from fastapi import Depends
from pydantic import Field

from service.operations import gradebook
from service.operations.gradebook import GradebookColumn, GradebookLine
from service.operations.types import JobState, Role
from service.web.api.shapes import Shape, build_example_config
from service.web.api_access import CallerInCourse, require_role
from service.web.api_routes import After, Limit, Listed, api_router, build_list_page, decode_cursor
from service.web.context import Context

router = api_router("people")
ReadAccess = Annotated[CallerInCourse, Depends(require_role(Role.INSTRUCTOR, "read"))]


class GradebookCellShape(Shape):
    """The grade that counts for a student in an assignment; the newest attempt if none counts."""

    assignment: str
    job_id: str
    state: JobState
    marks: float | None = Field(description="Null if no attempt counts.")
    max_marks: float
    days_late: int
    published_at: datetime | None
    provisional: bool

    model_config = build_example_config(
        assignment="shape-recognition",
        job_id="7xk2v9q4m0ab",
        state="done",
        marks=9.5,
        max_marks=12,
        days_late=0,
        published_at=None,
        provisional=False,
    )


class GradebookLineShape(Shape):
    """A student with their current grades. Assignments with hidden names are omitted."""

    enrolment: int = Field(description="ID for use in paths.")
    id: str = Field(description="ID in the course.")
    name: str
    email: str
    grades: list[GradebookCellShape] = Field(description="One for each assignment with a submission, by assignment.")

    model_config = build_example_config(enrolment=7, id="ada", name="Ada Lovelace", email="ada@example.org", grades=[])


@router.get("/courses/{course_id}/gradebook")
def list_gradebook(
    access: ReadAccess, context: Context, limit: Limit = 50, after: After = ""
) -> Listed[GradebookLineShape]:
    """List the students with their current grades, in the order of enrolment."""
    sort_key = decode_cursor(after, int)
    start = 0 if sort_key is None else sort_key[0]
    view = gradebook.show_after(context.service, access.actor, access.course_id, start, limit + 1)
    shapes = [_to_shape(line, view.columns) for line in view.lines]
    return build_list_page(shapes, limit, lambda each: [each.enrolment])


def _to_shape(line: GradebookLine, columns: Sequence[GradebookColumn]) -> GradebookLineShape:
    student = line.student
    cells = [line.cells[column.assignment] for column in columns if column.assignment in line.cells]
    return GradebookLineShape(
        enrolment=student.enrolment_id,
        id=student.id,
        name=student.name,
        email=student.email,
        grades=[GradebookCellShape.model_validate(cell) for cell in cells],
    )
