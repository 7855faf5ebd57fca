"""Runs and checks of students' notebooks: a magic's run to its next unanswered question, and checks without marks.

A run repeats from the start with one more answer until its program has ended, so no worker waits for a notebook.
Results are stored for a day.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from service.notebook_engine.checks import build_visible_assignment
from service.notebook_engine.requests import MagicRequest
from service.notebook_engine.stored_requests import build_owner, pack_check, pack_magic
from service.operations.context import Actor, Service
from service.operations.errors import Conflict, NotFound
from service.operations.lookup import require_own_enrolment
from service.operations.submissions import load_submission_target
from service.store.courses.assignment_versions import freeze_assignment
from service.store.queue import notebook_runs
from service.store.queue import test_runs as queue
from service.store.queue.notebook_runs import NotebookBusy, StudentNotebookRun
from service.store.queue.test_runs import NOTEBOOK_CHECKS, NOTEBOOK_RUNS
from service.store.states import Role
from submissions.raw_files import UploadedFile

__all__ = ["StudentNotebookRun"]


@dataclass(frozen=True, slots=True)
class NotebookRunWithResult:
    """A run or check of a notebook, and its compressed JSON result; None if there is none, or no longer."""

    run: StudentNotebookRun
    result: bytes | None


def start_run(
    service: Service, actor: Actor, course_id: int, request: MagicRequest, answers: Sequence[str | None]
) -> StudentNotebookRun:
    """Queue a magic with the answers to its first questions, and notify the workers. It needs no assignment.

    Raises NotFound if the actor is no student of the course, Conflict if their previous one is not completed, and
    UsageError if they have too many.
    """
    packed = pack_magic(request, answers)
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
    return _queue(service, enrolment_id, NOTEBOOK_RUNS, packed)


def start_check(
    service: Service, actor: Actor, course_id: int, assignment: str, files: Sequence[UploadedFile]
) -> StudentNotebookRun:
    """Queue a check of a notebook in the visible scenarios of an open assignment, and notify the workers.

    Raises like ``start_run``, and UsageError if the assignment is closed, has no visible scenario, or the files are not
    a valid submission.
    """
    target = load_submission_target(service, actor, course_id, assignment)
    build_visible_assignment(target.assignment)
    packed = pack_check(target.opened.version_id, target.read(files).submission)
    return _queue(service, target.enrolment_id, NOTEBOOK_CHECKS, packed)


def show(service: Service, actor: Actor, course_id: int, run_id: str) -> NotebookRunWithResult:
    """Return one of the actor's runs or checks. Raises NotFound."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
        run = notebook_runs.find_student_run(session, enrolment_id, run_id)
        if run is None:
            raise NotFound("There is no such page or item, or you have no access to it.")
        return NotebookRunWithResult(run, None if run.waits else queue.load_replay(session, run.id))


def find_ended(service: Service, run_ids: Collection[str]) -> list[str]:
    """Return those of the runs and checks that have ended. Their owners have been checked before."""
    with service.store.reading() as session:
        return notebook_runs.list_ended(session, run_ids)


def _queue(service: Service, enrolment_id: int, kind: str, packed: bytes) -> StudentNotebookRun:
    owner = freeze_assignment(build_owner(kind))
    try:
        with service.store.transaction() as session:
            run_id = notebook_runs.queue_notebook_run(session, enrolment_id, owner, packed)
            run = notebook_runs.find_student_run(session, enrolment_id, run_id)
    except NotebookBusy as error:
        raise Conflict(error.message) from None
    assert run is not None
    service.notifier.notify_test_runs()
    return run
