"""Short submissions, and a database with one graded submission, for benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

from responders.source_file import SourceFile
from service.grading.grader import grade
from service.store.batches import intake, stored_requests
from service.store.engine import Store
from service.store.grades import results
from service.store.queue import jobs
from submissions.assignment.reader import find_assignment
from submissions.grading_request import GradingRequest
from submissions.submission import Submission

ASSIGNMENT = "echo-responder"
_RESPONDER = "def responder(msg):\n    return msg\n"
_PROGRAM = """\
from ev3dev2.motor import MoveTank, SpeedPercent, OUTPUT_B, OUTPUT_C
tank = MoveTank(OUTPUT_B, OUTPUT_C)
for turn in range(3):
    tank.on_for_rotations(SpeedPercent(30), SpeedPercent(20), 0.5)
    print("PY::hello")
"""


def build_short_request(student: str) -> GradingRequest:
    """Return a request for a short submission. Each text differs: identical submissions are graded only once."""
    program = SourceFile("robot.py", f"# {student}\n{_PROGRAM}")
    return GradingRequest(
        Submission(student, program, SourceFile("responder.py", _RESPONDER)),
        find_assignment(ASSIGNMENT),
        f"{student}.zip",
    )


@dataclass(frozen=True, slots=True)
class GradedBatch:
    """A batch with one graded job."""

    batch: str
    job: str


def create_graded_batch(store: Store) -> GradedBatch:
    """Add a batch of one submission, grade it, and store its grade, without a queue."""
    batch = intake.accept_batch(store, "one", [build_short_request("ada")], [], max_attempts=3)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    with store.reading() as session:
        request = stored_requests.load_grading_request(session, claim.job_id)
    student_grade = grade(request.submission, request.assignment)
    jobs.finish_job(store, claim, results.prepare_grade(student_grade), datetime.now(UTC))
    return GradedBatch(batch.id, claim.job_id)
