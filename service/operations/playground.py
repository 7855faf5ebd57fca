"""Runs in the playground: a program in a world that its author chooses, without an assignment.

They are test runs: on the same queue, within the same limits, without marks, and kept for a day.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from service.operations.context import Actor, Service
from service.operations.lookup import require_own_enrolment
from service.operations.submissions import read_sent_files
from service.playground import DEFAULT_WORLD as DEFAULT_WORLD
from service.playground import PLAYGROUND_FILES as PLAYGROUND_FILES
from service.playground import PLAYGROUND_ID, STARTER_PROGRAM, build_playground, read_world
from service.playground import RANGES as RANGES
from service.playground import PlaygroundWorld as PlaygroundWorld
from service.playground import place_on_floor as place_on_floor
from service.reports.start_picture import StartPicture, build_start_picture
from service.store.courses.assignment_versions import (
    assignment_from_bytes,
    assignment_to_bytes,
    freeze_assignment,
    store_version,
)
from service.store.engine import now
from service.store.queue import test_runs
from service.store.queue.run_programs import add_assignment
from service.store.queue.test_runs import StudentTestRun
from service.store.states import Role
from service.test_runs import MAX_SECONDS
from sim.errors import UsageError
from sim.floors import list_floor_names
from submissions.raw_files import UploadedFile
from submissions.stored_submission import pack_submission, unpack_submission

_MEMBERS = (Role.STUDENT, Role.INSTRUCTOR)


@dataclass(frozen=True, slots=True)
class PlaygroundRequest:
    """Files to run, and the world to run them in."""

    world: PlaygroundWorld
    sent: Sequence[UploadedFile]


@dataclass(frozen=True, slots=True)
class PlaygroundView:
    """The actor's newest run in the playground, and the world and the texts to continue with."""

    world: PlaygroundWorld
    texts: tuple[str, ...]
    line: StudentTestRun | None
    replay: bytes | None  # compressed
    seconds: float = MAX_SECONDS  # simulated


def start(service: Service, actor: Actor, course_id: int, request: PlaygroundRequest) -> str:
    """Queue a run and notify the workers. Returns the id of the test run.

    Raises NotFound if the actor is not a member of the course. Raises UsageError for an invalid world, if the files are
    not a valid submission, or if the actor has too many test runs.
    """
    with service.store.reading() as session:
        enrolment = require_own_enrolment(session, actor, course_id, *_MEMBERS)
        enrolment_id, student = enrolment.id, enrolment.student
    assignment = build_playground(request.world)
    submission, _ = read_sent_files(request.sent, student, assignment.id, assignment.parts)
    stored_program = add_assignment(pack_submission(submission), assignment_to_bytes(assignment))
    # The row of all runs; the world of each is stored with its program.
    common_assignment = freeze_assignment(build_playground(DEFAULT_WORLD))
    with service.store.transaction() as session:
        version_id = store_version(session, common_assignment, now(session))
        test_run_id = test_runs.queue_test_run(session, enrolment_id, version_id, stored_program)
    service.notifier.notify_test_runs()
    return test_run_id


def show_newest(service: Service, actor: Actor, course_id: int) -> PlaygroundView:
    """Return the actor's newest run in the playground, or a program to begin with. Raises NotFound."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, *_MEMBERS).id
        line = test_runs.find_newest_run(session, enrolment_id, PLAYGROUND_ID)
        if line is None:
            return PlaygroundView(DEFAULT_WORLD, (STARTER_PROGRAM, ""), None, None)
        replay = test_runs.load_replay(session, line.id)
        packed_submission, content = test_runs.load_program(session, line.id)
    texts = unpack_submission(packed_submission).read_texts(PLAYGROUND_FILES)
    return PlaygroundView(read_world(assignment_from_bytes(content)), texts, line, replay)


def find_newest(service: Service, actor: Actor, course_id: int) -> StudentTestRun | None:
    """Return the state of the actor's newest run in the playground; None if there is none. Raises NotFound."""
    with service.store.reading() as session:
        enrolment_id = require_own_enrolment(session, actor, course_id, *_MEMBERS).id
        return test_runs.find_newest_run(session, enrolment_id, PLAYGROUND_ID)


def list_floors() -> tuple[str, ...]:
    """Return the names of the floors to choose from."""
    return list_floor_names()


def is_possible(world: PlaygroundWorld) -> bool:
    """Return whether programs can run in this world."""
    try:
        build_playground(world)
    except UsageError:
        return False
    return True


def show_picture(world: PlaygroundWorld) -> StartPicture:
    """Return the floor of a world with the robot on it. Raises UsageError for an invalid world."""
    return build_start_picture(build_playground(world))
