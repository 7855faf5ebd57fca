"""Test runs of student programs, without submitting them. They leave no marks and are kept for a day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum

from sqlalchemy.orm import Session

from service.operations import own_submissions
from service.operations.context import Actor, Service
from service.operations.errors import NotFound
from service.operations.lookup import require_own_enrolment
from service.operations.own_submissions import Allowance, OwnSubmission
from service.operations.own_views import find_opened_assignment, load_visible_assignment
from service.operations.submissions import load_submission_target
from service.reports.start_picture import StartPicture, build_start_picture
from service.store.queue import test_runs
from service.store.queue.test_runs import StudentTestRun
from service.store.states import Role
from service.test_runs import build_single_trial_assignment
from sim.errors import UsageError
from submissions.assignment.starter import read_starter
from submissions.assignment.task_sheet import TaskSheet, build_task_sheet
from submissions.raw_files import UploadedFile
from submissions.stored_submission import pack_submission, unpack_submission

__all__ = ["StudentTestRun"]


#: Submissions in a batch can have no time.
_UNKNOWN_TIME = datetime.min.replace(tzinfo=UTC)


class TextOrigin(StrEnum):
    """The program that a student continues with."""

    STARTER = "starter"
    ATTEMPT = "attempt"
    TEST_RUN = "test-run"


@dataclass(frozen=True, slots=True)
class TestRunView:
    """An assignment's task, the student's newest test run of it, and the texts to continue with.

    ``origins`` are the programs that exist; ``texts`` are those of ``origin``, in the order of the requested files.
    """

    sheet: TaskSheet
    seconds: float | None  # simulated; None without a scenario visible to students
    picture: StartPicture | None
    allowance: Allowance
    counting: OwnSubmission | None  # the one whose marks count
    is_open: bool
    closed_at: datetime | None  # None if it is open, or was never opened
    line: StudentTestRun | None
    replay: bytes | None  # compressed
    origins: tuple[TextOrigin, ...]
    origin: TextOrigin | None
    texts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class TestRunResult:
    """A student's newest test run of an assignment, and the names of the files that the assignment asks for."""

    line: StudentTestRun | None
    replay: bytes | None  # compressed
    files: tuple[str, ...]


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


def show_newest(
    service: Service, actor: Actor, course_id: int, assignment: str, origin: TextOrigin | None = None
) -> TestRunView:
    """Return the actor's newest test run of an assignment, and the texts of ``origin``, by default the latest.

    Raises NotFound if they may not see the assignment.
    """
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
        visible_assignment = load_visible_assignment(session, course_id, enrolment_id, assignment)
        sheet = build_task_sheet(visible_assignment)
        allowance = own_submissions.compute_allowance(session, enrolment_id, assignment)
        counting = own_submissions.load_own_attempts(session, enrolment_id, assignment).counting
        opened = find_opened_assignment(session, course_id, assignment)
        line = test_runs.find_newest_run(session, enrolment_id, assignment)
        replay = test_runs.load_replay(session, line.id) if line else None
        texts_by_origin = _load_texts(session, enrolment_id, sheet, line)
    trial_assignment = build_single_trial_assignment(visible_assignment)
    shown_origin = origin if origin in texts_by_origin else next(iter(texts_by_origin), None)
    return TestRunView(
        sheet,
        trial_assignment.scenarios[0].seconds if trial_assignment else None,
        build_start_picture(trial_assignment) if trial_assignment else None,
        allowance,
        counting,
        opened is not None and opened.open,
        None if opened is None else opened.closed_at,
        line,
        replay,
        tuple(each for each in TextOrigin if each in texts_by_origin),
        shown_origin,
        texts_by_origin[shown_origin] if shown_origin else ("",) * len(sheet.asked),
    )


def _load_texts(
    session: Session, enrolment_id: int, sheet: TaskSheet, line: StudentTestRun | None
) -> dict[TextOrigin, tuple[str, ...]]:
    """Return the texts of the newest test run, the newest attempt and the starter files, the latest first."""
    attempt = own_submissions.find_newest_row(session, enrolment_id, sheet.id)
    packed_programs = []
    if line is not None:
        packed_programs.append((line.queued_at, TextOrigin.TEST_RUN, test_runs.load_program(session, line.id)[0]))
    if attempt is not None:
        packed_programs.append((attempt.submitted_at or _UNKNOWN_TIME, TextOrigin.ATTEMPT, attempt.packed))
    texts = {
        origin: unpack_submission(packed).read_texts(sheet.asked)
        for _, origin, packed in sorted(packed_programs, key=lambda each: each[0], reverse=True)
    }
    starter = read_starter(sheet.id)
    texts[TextOrigin.STARTER] = tuple(starter.get(name, "") for name in sheet.asked)
    # A notebook has no such files.
    return {origin: each for origin, each in texts.items() if any(each)}


def show_newest_result(service: Service, actor: Actor, course_id: int, assignment: str) -> TestRunResult:
    """Return the actor's newest test run of an assignment. Raises NotFound if they may not see the assignment."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
        sheet = build_task_sheet(load_visible_assignment(session, course_id, enrolment_id, assignment))
        line = test_runs.find_newest_run(session, enrolment_id, assignment)
        return TestRunResult(line, test_runs.load_replay(session, line.id) if line else None, sheet.asked)


def find_newest(service: Service, actor: Actor, course_id: int, assignment: str) -> StudentTestRun | None:
    """Return the state of the actor's newest test run of an assignment; None if there is none."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, Role.STUDENT).id
        return test_runs.find_newest_run(session, enrolment_id, assignment)


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
    enrolment = require_own_enrolment(session, actor, course_id, Role.STUDENT, Role.INSTRUCTOR)
    line = test_runs.find_student_run(session, enrolment.id, tryout_id)
    if line is None:
        raise NotFound("There is no such page or item, or you have no access to it.")
    return line
