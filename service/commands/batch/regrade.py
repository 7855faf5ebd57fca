"""``robomark batch regrade``, ``publish`` and related commands: regrade, compare and publish grades."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.control import DEFAULT_PASS_MARK, BatchId, PassMark
from service.commands.installation import open_installation
from service.commands.output import print_json, print_line, print_note, print_renderables
from sim.errors import HostError

if TYPE_CHECKING:
    from service.operations.regrades import PublicationCounts, RegradeBatch
    from submissions.assignment.definition import Assignment

GradeId = Annotated[str, typer.Argument(help="The grade's id, or its first characters.")]


def regrade(
    batch: BatchId,
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="The changed assignment: its id or its folder.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the new grades, then show the changes.")] = False,
    pass_mark: PassMark = DEFAULT_PASS_MARK,
) -> None:
    """Grade a batch again after its assignment or the grader changed; the old grades stay valid until you publish."""
    # The queue loads slowly, and publishing does not need it.
    from service.commands.batch.grading_services import NullNotifier, pending_batches
    from service.operations import batches
    from service.operations import regrades as operations
    from service.operations.types import JobState

    changed_assignment = _resolve_assignment(assignment)
    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        regrade_service = replace(service, notifier=NullNotifier()) if wait else service
        new_batch = operations.regrade_batch(
            regrade_service, actor, stored_batch.course_id, stored_batch.id, changed_assignment
        )
        print_line(f"batch {new_batch.batch_id}: {new_batch.jobs} queued for regrading{_describe_omitted(new_batch)}")
        if not wait:
            print_note(f"changes and reasons: robomark batch status {new_batch.batch_id}")
            print_json(batch=new_batch.batch_id, regraded=new_batch)
            return
        from service.commands.batch.tables import build_changes_table
        from service.queue.logs import configure_logging

        configure_logging(service.settings.log_level)
        with pending_batches(service, actor, [new_batch.batch_id], new_batch.jobs) as pending_regrade:
            pending_regrade.wait_for_marks()
            pass_share = Decimal(pass_mark) / 100
            changes = operations.list_changes(service, actor, stored_batch.course_id, new_batch.batch_id, pass_share)
            changes_summary = operations.summarise_changes(changes, pass_share)
            print_renderables(build_changes_table(changes, changes_summary))
            print_note(f"to publish the new grades: robomark batch publish {new_batch.batch_id}")
            pending_regrade.wait_for_plots()
    print_json(batch=new_batch.batch_id, regraded=new_batch, changes=changes, changes_summary=changes_summary)
    failed_changes = [change for change in changes if change.state is JobState.DEAD]
    if failed_changes:
        raise HostError(
            f"{len(failed_changes)} of {len(changes)} could not be graded; {failed_changes[0].student}: "
            f"{failed_changes[0].reason}"
        )


def publish(
    batch: BatchId,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Also publish provisional grades, and those with an unjudged criterion.")
    ] = False,
) -> None:
    """Publish the newest grades of a batch: they replace older grades, and students see them."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        publication = operations.publish(
            service, actor, stored_batch.course_id, stored_batch.id, includes_held_back=anyway
        )
    print_json(batch=stored_batch.id, published=publication)
    _print_published(f"batch {stored_batch.id}", publication)


def publish_one(
    grade: GradeId,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Also publish provisional grades, and those with an unjudged criterion.")
    ] = False,
) -> None:
    """Publish the newest grade of one submission: it replaces older grades, and the student sees it."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        publication = operations.publish_one(
            service, actor, stored_grade.course_id, stored_grade.id, includes_held_back=anyway
        )
    print_json(grade=stored_grade.id, published=publication)
    _print_published(f"grade {stored_grade.id}", publication)


def regrade_one(
    grade: GradeId,
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="The changed assignment: its id or its folder.")
    ] = None,
) -> None:
    """Grade the submission of one grade again; the old grade stays valid until you publish."""
    from service.operations import batches
    from service.operations import regrades as operations

    changed_assignment = _resolve_assignment(assignment)
    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        job = operations.regrade_one(service, actor, stored_grade.course_id, stored_grade.id, changed_assignment)
    print_json(grade=stored_grade.id, job=job)
    print_line(f"grade {stored_grade.id}: queued for regrading as {job}")
    print_note(f"to publish the new grade: robomark batch publish-one {job}")


def grade_over_limit(grade: GradeId) -> None:
    """Grade a submission that was put aside because it is over a limit."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        stored_grade = batches.find_grade(service, actor, grade)
        operations.grade_over_limit(service, actor, stored_grade.course_id, stored_grade.id)
    print_json(grade=stored_grade.id)
    print_line(f"grade {stored_grade.id} is queued")


def preview_publication(batch: BatchId) -> None:
    """Show what publishing a batch would do now, and change nothing."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        stored_batch = batches.find(service, actor, batch)
        preview = operations.preview_publication(service, actor, stored_batch.course_id, stored_batch.id)
    print_json(
        batch=stored_batch.id,
        publication=preview.counts,
        students=preview.students,
        completion_seconds=preview.completion_seconds,
    )
    print_line(
        f"batch {stored_batch.id}, {preview.students} students: {_describe_published(preview.counts, 'to publish')}"
    )


def _resolve_assignment(name: str | None) -> Assignment | str:
    """Return an assignment id as given, or the assignment if ``name`` is a folder on this machine."""
    from submissions.assignment.folder import list_catalogue_ids
    from submissions.assignment.reader import find_assignment

    if name is None:
        return ""
    return find_assignment(name) if Path(name).exists() and name not in list_catalogue_ids() else name


def _print_published(subject: str, publication: PublicationCounts) -> None:
    print_line(f"{subject}: {_describe_published(publication, 'published')}")


def _describe_published(publication: PublicationCounts, verb: str) -> str:
    """Return a sentence with the number of published grades and of those held back, with reasons."""
    omissions = [
        f"{count} {what}"
        for count, what in (
            (publication.unfinished, "not graded yet"),
            (publication.dead, "could not be graded"),
            (publication.staff_only, "over a limit and for staff only"),
            (publication.unjudged, "with criteria that could not be judged (--anyway publishes them)"),
            (publication.provisional, "provisional until all trials are run (--anyway publishes them)"),
        )
        if count
    ]
    replaced = f", {publication.replaced} of them regrades" if publication.replaced else ""
    return (
        f"{publication.published} grades "
        f"{verb}{replaced}{'; not published: ' if omissions else ''}{', '.join(omissions)}"
    )


def _describe_omitted(new_batch: RegradeBatch) -> str:
    omissions = []
    if new_batch.other_assignment:
        omissions.append(f"{new_batch.other_assignment} left out, for another assignment")
    if new_batch.unfinished:
        omissions.append(f"{new_batch.unfinished} left out, not graded yet")
    return "".join(f"; {sentence}" for sentence in omissions)
