"""Downloads of a batch's grades, in every format of the command line, and its moderation sheets.

``service.reports`` writes the formats. Hidden names are hidden in files, too.
"""

from __future__ import annotations

import codecs
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, Request, UploadFile
from fastapi.responses import Response

from service.operations.exports import ExportRequest, download
from service.operations.moderation import download_sheet
from service.operations.types import Role
from service.web.access import CourseInstructor, ReaderInCourse, RowName
from service.web.api_uploads import MAX_TABLE_BYTES
from service.web.attachments import respond_with_attachment
from service.web.context import EXPORT_IN_PROGRESS, Context, WebContext, hold_slot
from service.web.language import detect_language
from service.web.request_bodies import takes_upload
from sim.errors import UsageError

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
_TABLES = ("csv", "csv-long")
_WORKSHEET = "moodle-worksheet"


@router.get("/export")
def export(
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    form: Annotated[str, Query(alias="format", max_length=40)] = "csv",
    published: Annotated[bool, Query()] = False,
) -> Response:
    """Return the current grades in the requested format."""
    return _respond_with_export(access, context, batch_id, ExportRequest(form, published))


@router.get("/moderation")
def download_moderation_sheet(
    request: Request,
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    assignment: Annotated[str, Query(max_length=100)] = "",
) -> Response:
    """Return the moderation sheet of an assignment in the batch."""
    with hold_slot(context.batch_exports.get_slot(access.actor.person_id), EXPORT_IN_PROGRESS):
        sheet = download_sheet(
            context.service, access.actor, access.course_id, batch_id, assignment, detect_language(request)
        )
    return respond_with_attachment(sheet.data, sheet.name, sheet.media_type)


@router.post("/worksheet")
@takes_upload(MAX_TABLE_BYTES, Role.INSTRUCTOR)
def fill_worksheet(
    access: CourseInstructor,
    context: Context,
    batch_id: RowName,
    file: Annotated[UploadFile, File()],
    published: Annotated[bool, Form()] = False,
) -> Response:
    """Return Moodle's grading worksheet with the grades filled in."""
    try:
        content = file.file.read().decode("utf-8")
    except UnicodeDecodeError:
        raise UsageError("the worksheet is not in UTF-8; upload the original file from Moodle") from None
    return _respond_with_export(access, context, batch_id, ExportRequest(_WORKSHEET, published, content))


def _respond_with_export(
    access: ReaderInCourse, context: WebContext, batch_id: str, export_request: ExportRequest
) -> Response:
    with hold_slot(context.batch_exports.get_slot(access.actor.person_id), EXPORT_IN_PROGRESS):
        exported = download(context.service, access.actor, access.course_id, batch_id, export_request)
    # Excel recognises UTF-8 only by a byte order mark. Moodle's worksheet stays as Moodle wrote it.
    byte_order_mark = codecs.BOM_UTF8 if export_request.form in _TABLES else b""
    return respond_with_attachment(byte_order_mark + exported.data, exported.name, exported.media_type)
