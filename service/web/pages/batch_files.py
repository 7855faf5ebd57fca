"""The grades of a batch as a file that the browser keeps: every format of the command line.

What a format writes is ``service.reports``'; names are in it, whether or not they are hidden while it is marked.
"""

from __future__ import annotations

import codecs
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, UploadFile
from fastapi.responses import Response

from service.batch_export import export_file
from service.web.access import InCourse, Instructing, RowName, batch_in
from service.web.attachments import attachment
from service.web.context import Context, WebContext
from sim.errors import UsageError

router = APIRouter(prefix="/courses/{course_id}/batches/{batch_id}")
_TABLES = ("csv", "csv-long")
_WORKSHEET = "moodle-worksheet"
_LARGEST_WORKSHEET = 10 * 2**20


@router.get("/export")
def export(
    here: Instructing,
    context: Context,
    batch_id: RowName,
    form: Annotated[str, Query(alias="format", max_length=40)] = "csv",
    published: Annotated[bool, Query()] = False,
) -> Response:
    """The grades that stand, in one of the formats."""
    return _file(here, context, batch_id, form, published=published)


@router.post("/worksheet")
def worksheet(
    here: Instructing,
    context: Context,
    batch_id: RowName,
    file: Annotated[UploadFile, File()],
    published: Annotated[bool, Form()] = False,
) -> Response:
    """Moodle's grading worksheet with the grades filled in."""
    data = file.file.read(_LARGEST_WORKSHEET + 1)
    if len(data) > _LARGEST_WORKSHEET:
        raise UsageError(f"the worksheet is larger than {_LARGEST_WORKSHEET >> 20} MB, expected it as Moodle wrote it")
    try:
        given = data.decode("utf-8")
    except UnicodeDecodeError:
        raise UsageError("the worksheet is not UTF-8; expected it as Moodle wrote it") from None
    return _file(here, context, batch_id, _WORKSHEET, published=published, given=given)


def _file(
    here: InCourse, context: WebContext, batch_id: str, form: str, *, published: bool, given: str = ""
) -> Response:
    with context.store.reading() as session:
        batch_in(session, here.course_id, batch_id)
    made = export_file(context.store, batch_id, form, published=published, given=given)
    # Excel takes a table for UTF-8 only where it begins so; Moodle has its own.
    mark = codecs.BOM_UTF8 if form in _TABLES else b""
    return attachment(mark + made.data, made.name, made.media_type)
