"""``robomark course export-student``, ``delete-student`` and ``purge``: export or delete personal and old data.

``service/store/purge.py`` contains the rules.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from service.commands.installation import open_installation
from service.commands.output import print_json, print_line, print_note
from service.operations import courses, people, privacy
from service.operations.context import Actor, Service
from service.operations.courses import DEFAULT_COURSE
from service.operations.privacy import PurgeCounts, PurgeRequest
from sim.errors import UsageError

StudentArgument = Annotated[str, typer.Argument(help="The student's name, as submitted.")]


def export_student(
    student: StudentArgument, output: Annotated[Path, typer.Option("-o", "--output", help="The .zip file to create.")]
) -> None:
    """Export all data of a student that the student may see: identity, submissions and results."""
    from service.home import user_permissions

    with open_installation() as (service, actor):
        member = people.find(service, actor, DEFAULT_COURSE, student)
        data = privacy.export_student(service, actor, member.course_id, member.enrolment_id).zip
    try:
        with user_permissions():
            output.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{output} cannot be written: {error.strerror}") from None
    print_json(student=student, output=output, bytes=len(data))
    print_line(f"{output}: {len(data)} bytes")


def delete_student(
    student: StudentArgument,
    for_good: Annotated[bool, typer.Option("--for-good", help="Confirm the deletion. It cannot be undone.")] = False,
) -> None:
    """Delete all data of a student: submissions, grades, recordings and identity.

    The audit log keeps an entry without the name. Earlier backups still contain the data.
    """
    if not for_good:
        raise UsageError("this cannot be undone; export a copy with export-student if needed, then use --for-good")
    with open_installation() as (service, actor):
        member = people.find(service, actor, DEFAULT_COURSE, student)
        removed_counts = privacy.erase_student(service, actor, member.course_id, member.enrolment_id)
    print_json(submissions=removed_counts.submissions, grades=removed_counts.grades)
    print_line(
        f"removed: {removed_counts.submissions} submissions, {removed_counts.grades} grades, and the student's identity"
    )


def purge_course(
    older_than: Annotated[
        int, typer.Option(min=1, max=36_500, help="Remove submissions that are older than this number of days.")
    ],
    archive: Annotated[Path | None, typer.Option(help="Back up the whole database to this file first.")] = None,
    for_good: Annotated[bool, typer.Option("--for-good", help="Do not create a backup.")] = False,
) -> None:
    """Remove old submissions, with their grades and recordings, and students without other submissions.

    Without --archive or --for-good, show how much would be removed.
    """
    remove_or_count(
        archive,
        for_good,
        lambda service, actor, only_count: privacy.purge(
            service, actor, courses.find(service, actor, DEFAULT_COURSE), PurgeRequest(older_than, only_count)
        ),
    )


def remove_or_count(
    archive: Path | None, for_good: bool, remove: Callable[[Service, Actor, bool], PurgeCounts]
) -> None:
    """Remove data after a backup to ``archive``, or ``for_good``; without either, only count it. Print the counts."""
    if archive is not None and for_good:
        raise UsageError("--archive keeps a copy and --for-good keeps none; use one of them")
    only_count = archive is None and not for_good
    with open_installation() as (service, actor):
        if archive is not None:
            print_note(f"{archive}: {privacy.archive(service, actor, archive)} bytes")
        removed_counts = remove(service, actor, only_count)
    count_text = (
        f"{removed_counts.submissions} submissions, {removed_counts.grades} grades, {removed_counts.students} students"
    )
    print_json(removed=not only_count, archive=archive, **asdict(removed_counts))
    print_line(
        f"{count_text} to remove; use --archive FILE or --for-good to remove them"
        if only_count
        else f"removed: {count_text}"
    )
