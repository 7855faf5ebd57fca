"""Test runs of student programs, without submitting them. They leave no marks and are kept for a day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import NotFound
from service.operations.lookup import require_own_enrolment
from service.operations.own_views import load_visible_assignment
from service.operations.submissions import load_submission_target
from service.store.queue import test_runs
from service.store.queue.test_runs import StudentTestRun
from service.store.states import Role
from service.test_runs import build_single_trial_assignment
from sim.errors import UsageError
from submissions.assignment.task_sheet import TaskSheet, build_task_sheet
from submissions.raw_files import UploadedFile
from submissions.stored_submission import pack_submission, unpack_submission
from submissions.submission import Submission

__all__ = ["StudentTestRun"]


@dataclass(frozen=True, slots=True)
class TestRunView:
    """A student's newest test run of an assignment, and the assignment's task."""

    sheet: TaskSheet
    seconds: float | None  # simulated; None without a scenario visible to students
    line: StudentTestRun | None
    replay: bytes | None  # compressed
    submission: Submission | None


def start(service: Service, actor: Actor, course_id: int, assignment: str, files: Sequence[UploadedFile]) -> str:
    """Queue a test run and notify the workers. Returns the id of the test run.

    Raises NotFound if students cannot see the assignment. Raises UsageError if it is closed or has no visible scenario,
    the files are not a valid submission, or the student has too many test runs.
    """
    target = load_submission_target(service, actor, course_id, assignment)
    if build_single_trial_assignment(target.assignment) is None:
        raise UsageError("test runs are not available for this assignment; submit your files instead.")
    packed_submission = pack_submission(target.read(files).submission)
    with service.store.transaction() as session:
        test_run_id = test_runs.queue_test_run(
            session, target.enrolment_id, target.opened.version_id, packed_submission
        )
    service.notifier.notify_test_runs()
    return test_run_id


def show_newest(service: Service, actor: Actor, course_id: int, assignment: str) -> TestRunView:
    """Return the actor's newest test run of an assignment, with its program. Raises NotFound if they may not see it."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
        visible_assignment = load_visible_assignment(session, course_id, enrolment_id, assignment)
        newest_id = test_runs.find_newest_run(session, enrolment_id, assignment)
        line = test_runs.find_student_run(session, enrolment_id, newest_id) if newest_id else None
        replay = test_runs.load_replay(session, newest_id) if newest_id else None
        submission = unpack_submission(test_runs.load_program(session, newest_id)[0]) if newest_id else None
    trial_assignment = build_single_trial_assignment(visible_assignment)
    return TestRunView(
        build_task_sheet(visible_assignment),
        trial_assignment.scenarios[0].seconds if trial_assignment else None,
        line,
        replay,
        submission,
    )


def find_newest(service: Service, actor: Actor, course_id: int, assignment: str) -> StudentTestRun | None:
    """Return the state of the actor's newest test run of an assignment; None if there is none."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
        newest_id = test_runs.find_newest_run(session, enrolment_id, assignment)
        return test_runs.find_student_run(session, enrolment_id, newest_id) if newest_id else None


def show(service: Service, actor: Actor, course_id: int, tryout_id: str) -> StudentTestRun:
    """Return one of the actor's test runs. Raises NotFound."""
    with service.store.reading() as session:
        return _require_test_run(session, actor, course_id, tryout_id)


def show_replay(service: Service, actor: Actor, course_id: int, tryout_id: str) -> bytes:
    """Return the compressed replay of one of the actor's test runs. Raises NotFound, also without a replay."""
    with service.store.reading() as session:
        replay = test_runs.load_replay(session, _require_test_run(session, actor, course_id, tryout_id).id)
    if replay is None:
        raise NotFound("There is no such page or item, or you have no access to it.")
    return replay


def _require_test_run(session: Session, actor: Actor, course_id: int, tryout_id: str) -> StudentTestRun:
    line = test_runs.find_student_run(
        session, require_own_enrolment(session, actor, course_id, Role.STUDENT).id, tryout_id
    )
    if line is None:
        raise NotFound("There is no such page or item, or you have no access to it.")
    return line
