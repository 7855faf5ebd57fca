"""Time of one short submission in the embedded service, until its marks and its plots are in the database."""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.measurement import SECONDS, Measurement
from service.queue.celery_app import make_celery
from service.queue.embedded_services import EmbeddedServices
from service.queue.notifier import Notifier
from service.settings import load_settings
from service.store.batches import intake
from service.store.engine import Store, open_store
from service.store.states import JobQueue, JobState, PlotState
from service.store.tables.submissions import Job
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest

_ASSIGNMENT = "json-queue"
_TIMES = 7


def measure(_times: int) -> list[Measurement]:
    """Measure the medians with a warm worker."""
    with tempfile.TemporaryDirectory() as folder:
        settings = load_settings(home=Path(folder))
        with open_store(settings) as store, EmbeddedServices(settings, store) as services:
            notifier = Notifier(make_celery(services.settings), store, services.settings)
            runs = [_measure_once(store, notifier, f"student {number}") for number in range(_TIMES + 1)][1:]
    marks, plots = (sorted(times)[_TIMES // 2] for times in zip(*runs, strict=True))
    return [
        Measurement("one short submission, embedded, to marks in the database", marks, SECONDS, 1, 0.4),
        Measurement("the same, to plots", plots, SECONDS, 4, 2),
    ]


def _measure_once(store: Store, notifier: Notifier, student: str) -> tuple[float, float]:
    """Return the seconds until the marks are committed, and until the plots are."""
    assignment = find_assignment(_ASSIGNMENT)
    start = time.perf_counter()
    submission = read_submission(
        locate_examples(_ASSIGNMENT) / "reference", student=student, required_parts=assignment.parts
    )
    # One file differs, because identical submissions are graded only once.
    submission = replace(submission, files={**submission.files, "student.txt": student.encode()})
    job = intake.accept_submission(store, GradingRequest(submission, assignment, student), max_attempts=3).job_id
    notifier.grade(JobQueue.INTERACTIVE)
    marks = None
    while True:
        with store.reading() as session:
            row = session.get_one(Job, job)
            state, plots = row.state, row.plots
        if marks is None and state is JobState.DONE:
            marks = time.perf_counter() - start
        if marks is not None and plots is PlotState.DONE:
            return marks, time.perf_counter() - start
        if state is JobState.DEAD or time.perf_counter() - start > 120:
            raise RuntimeError(f"the submission is {state} after {time.perf_counter() - start:.0f} s")
        time.sleep(0.01)
