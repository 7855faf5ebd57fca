"""``robomark batch submit``: its options. ``batch_submission.py``, which loads slowly, does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.commands.installation import open_installation
from sim.errors import UsageError


def submit(
    grading_requests: Annotated[
        Path, typer.Argument(help="A folder or .zip file with one submission for each student, or a .csv roster.")
    ],
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="The assignment's id in the catalogue, or its folder.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the marks and show them.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Wait, then write a report for each submission to this folder."),
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Grade unchanged submissions again.")] = False,
    people: Annotated[
        Path | None,
        typer.Option(
            help="The students of the course: a .csv file with id, name and email, such as Moodle's grading worksheet."
        ),
    ] = None,
    course: Annotated[str | None, typer.Option(help="The course, if there are several.")] = None,
) -> None:
    """Queue a submission for each student. Invalid submissions are listed and do not affect the others.

    Downloads from Moodle, Gradescope and nbgrader work unchanged. A roster has the columns student (or id) and file,
    and optionally name, email and assignment. Its files are in the roster's folder or below. A student's new
    submission replaces one in the queue. An unchanged submission is not graded again.

    Exit status 0 if all were accepted (and, with --wait, graded), 2 if some were rejected, 3 if some could not be
    graded.
    """
    if wait or output is not None:
        rejected_count = submit_and_wait(
            grading_requests, assignment, output=output, again=again, people=people, course=course
        )
    else:
        from service.commands.batch import batch_submission

        rejected_count = batch_submission.submit(
            batch_submission.BatchToSubmit(grading_requests, assignment, people, course, again)
        )
    if rejected_count:
        subject = "submission was" if rejected_count == 1 else "submissions were"
        raise UsageError(f"{rejected_count} {subject} rejected; the others are queued")


def submit_and_wait(
    grading_requests: Path,
    assignment: str | None,
    *,
    output: Path | None,
    again: bool = True,
    people: Path | None = None,
    course: str | None = None,
) -> int:
    """Queue submissions, wait for their grades and return the number of rejected submissions.

    Uses the running services, or starts its own.
    """
    from service.commands.batch.grading_services import grading_services
    from service.queue.logs import configure_logging
    from service.reports.output_files import prepare_folder

    if output is not None:
        prepare_folder(output)
    with open_installation() as (service, actor), grading_services(service) as services:
        configure_logging(service.settings.log_level)
        # The worker starts during this import and while submissions are read and stored.
        from service.commands.batch.batch_submission import BatchToSubmit, submit_and_grade

        batch = BatchToSubmit(grading_requests, assignment, people, course, again)
        return submit_and_grade(services, service, actor, batch, output)
