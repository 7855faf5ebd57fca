"""``robomark course export-student``, ``delete-student`` and ``purge``: a student's data on request, and what is old.

What goes is decided in ``store/purge.py``.
"""

from __future__ import annotations

from dataclasses import asdict
from datetime import timedelta
from pathlib import Path
from typing import Annotated

import typer

from service.commands.shown import document, note, tell
from service.settings import load_settings
from service.store import audit
from service.store.backup import back_up
from service.store.engine import Store, now, open_store
from service.store.people.students import DEFAULT_COURSE, Students, course_of
from service.store.purge import erase_student, purge
from sim.errors import UsageError

Who = Annotated[str, typer.Argument(help="The student's name, as submitted.")]


def export_student(
    student: Who, output: Annotated[Path, typer.Option("-o", "--output", help="The zip to write.")]
) -> None:
    """Write all there is of a student, as they may see it: who they are, what they submitted, and what came of it."""
    # Reports take long to load.
    from service.home import for_the_user
    from service.student_export import export_student as exported

    with open_store(load_settings()) as store:
        data = exported(store, _find(store, student))
    try:
        with for_the_user():
            output.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{output} cannot be written: {error.strerror}") from None
    document(student=student, output=output, bytes=len(data))
    tell(f"{output}: {len(data)} bytes")


def delete_student(
    student: Who,
    for_good: Annotated[bool, typer.Option("--for-good", help="Really; nothing of it comes back.")] = False,
) -> None:
    """Remove all there is of a student: submissions, grades, recordings, and who they are.

    The audit keeps that it was done, without the name. Backups that were made before still have it.
    """
    if not for_good:
        raise UsageError("this cannot be undone; say --for-good, after export-student if a copy is wanted")
    with open_store(load_settings()) as store:
        gone = erase_student(store, _find(store, student), audit.this_user())
    document(submissions=gone.submissions, grades=gone.grades)
    tell(f"removed: {gone.submissions} submissions, {gone.grades} grades, and who the student was")


def purge_course(
    older_than: Annotated[int, typer.Option(min=1, max=36_500, help="Days since it was taken in.")],
    archive: Annotated[Path | None, typer.Option(help="Back the whole database up into this file first.")] = None,
    for_good: Annotated[bool, typer.Option("--for-good", help="Keep no copy.")] = False,
) -> None:
    """Remove what was submitted so long ago, with grades, recordings and students who have nothing left.

    Without --archive or --for-good it says how much would go.
    """
    if archive is not None and for_good:
        raise UsageError("--archive keeps a copy and --for-good keeps none; name one of them")
    only_count = archive is None and not for_good
    with open_store(load_settings()) as store:
        with store.transaction() as session:
            at = now(session)
            course_id = course_of(session, DEFAULT_COURSE, at)
        if archive is not None:
            back_up(store.engine, archive)
            note(f"{archive}: {archive.stat().st_size} bytes")
        before = at - timedelta(days=older_than)
        gone = purge(store, before, audit.this_user(), course_id=course_id, only_count=only_count)
    counted = f"{gone.submissions} submissions, {gone.grades} grades, {gone.students} students"
    document(removed=not only_count, archive=archive, **asdict(gone))
    tell(f"{counted} would go; --archive FILE or --for-good removes them" if only_count else f"removed: {counted}")


def _find(store: Store, student: str) -> int:
    with store.transaction() as session:
        return Students(session, course_of(session, DEFAULT_COURSE, now(session))).find(student)
