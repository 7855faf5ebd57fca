"""``robomark batch regrade``, ``publish`` and related commands: regrade, compare and publish grades."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.batch.control import BatchId
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
) -> None:
    """Grade a batch again after its assignment or the grader changed; the old grades stay valid until you publish."""
    # The queue loads slowly, and publishing does not need it.
    from service.commands.batch.grading_services import NullNotifier, pending_batches
    from service.operations import batches
    from service.operations import regrades as operations
    from service.operations.types import JobState

    changed = _resolve_assignment(assignment)
    with open_installation() as (service, actor):
        found = batches.find(service, actor, batch)
        by = replace(service, notifier=NullNotifier()) if wait else service
        made = operations.regrade_batch(by, actor, found.course_id, found.id, changed)
        print_line(f"batch {made.batch_id}: {made.jobs} queued for regrading{_describe_omitted(made)}")
        if not wait:
            print_note(f"changes and reasons: robomark batch status {made.batch_id}")
            print_json(batch=made.batch_id, regraded=made)
            return
        from service.commands.batch.tables import build_changes_table
        from service.queue.logs import configure_logging

        configure_logging(service.settings.log_level)
        with pending_batches(service, actor, [made.batch_id], made.jobs) as regraded:
            regraded.wait_for_marks()
            changes = operations.list_changes(service, actor, found.course_id, made.batch_id)
            print_renderables(build_changes_table(changes))
            print_note(f"to publish the new grades: robomark batch publish {made.batch_id}")
            regraded.wait_for_plots()
    print_json(batch=made.batch_id, regraded=made, changes=changes)
    dead = [change for change in changes if change.state is JobState.DEAD]
    if dead:
        raise HostError(f"{len(dead)} of {len(changes)} could not be graded; {dead[0].student}: {dead[0].reason}")


def publish(
    batch: BatchId,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Publish even if a criterion could not be judged. It gives no marks.")
    ] = False,
) -> None:
    """Publish the newest grades of a batch: they replace older grades, and students see them."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        found = batches.find(service, actor, batch)
        done = operations.publish(service, actor, found.course_id, found.id, anyway=anyway)
    print_json(batch=found.id, published=done)
    _print_published(f"batch {found.id}", done)


def publish_one(
    grade: GradeId,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Publish even if a criterion could not be judged. It gives no marks.")
    ] = False,
) -> None:
    """Publish the newest grade of one submission: it replaces older grades, and the student sees it."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        done = operations.publish_one(service, actor, found.course_id, found.id, anyway=anyway)
    print_json(grade=found.id, published=done)
    _print_published(f"grade {found.id}", done)


def regrade_one(
    grade: GradeId,
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="The changed assignment: its id or its folder.")
    ] = None,
) -> None:
    """Grade the submission of one grade again; the old grade stays valid until you publish."""
    from service.operations import batches
    from service.operations import regrades as operations

    changed = _resolve_assignment(assignment)
    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        job = operations.regrade_one(service, actor, found.course_id, found.id, changed)
    print_json(grade=found.id, job=job)
    print_line(f"grade {found.id}: queued for regrading as {job}")
    print_note(f"to publish the new grade: robomark batch publish-one {job}")


def grade_over_limit(grade: GradeId) -> None:
    """Grade a submission that was put aside because it is over a limit."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        found = batches.find_grade(service, actor, grade)
        operations.grade_over_limit(service, actor, found.course_id, found.id)
    print_json(grade=found.id)
    print_line(f"grade {found.id} is queued")


def preview_publication(batch: BatchId) -> None:
    """Show what publishing a batch would do now, and change nothing."""
    from service.operations import batches
    from service.operations import regrades as operations

    with open_installation() as (service, actor):
        found = batches.find(service, actor, batch)
        would = operations.preview_publication(service, actor, found.course_id, found.id)
    print_json(batch=found.id, publication=would.counts, students=would.students)
    print_line(f"batch {found.id}, {would.students} students: {_describe_published(would.counts, 'to publish')}")


def _resolve_assignment(name: str | None) -> Assignment | str:
    """Return an assignment id as given, or the assignment if ``name`` is a folder on this machine."""
    from submissions.assignment.folder import list_catalogue_ids
    from submissions.assignment.reader import find_assignment

    if name is None:
        return ""
    return find_assignment(name) if Path(name).exists() and name not in list_catalogue_ids() else name


def _print_published(of_what: str, done: PublicationCounts) -> None:
    print_line(f"{of_what}: {_describe_published(done, 'published')}")


def _describe_published(done: PublicationCounts, verb: str) -> str:
    """Return a sentence with the number of published grades and of those held back, with reasons."""
    left = [
        f"{count} {what}"
        for count, what in (
            (done.unfinished, "not graded yet"),
            (done.dead, "could not be graded"),
            (done.staff_only, "over a limit and for staff only"),
            (done.unjudged, "with criteria that could not be judged (--anyway publishes them)"),
        )
        if count
    ]
    replaced = f", {done.replaced} of them regrades" if done.replaced else ""
    return f"{done.published} grades {verb}{replaced}{'; not published: ' if left else ''}{', '.join(left)}"


def _describe_omitted(made: RegradeBatch) -> str:
    left = []
    if made.other_assignment:
        left.append(f"{made.other_assignment} left out, for another assignment")
    if made.unfinished:
        left.append(f"{made.unfinished} left out, not graded yet")
    return "".join(f"; {sentence}" for sentence in left)
