"""Honest submissions among floods of every kind, in a worker with little memory: no honest mark changes."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Decimal
from pathlib import Path

import pytest
from sqlalchemy import func, select

from benchmarks.harness.postgresql_server import create_database
from builders import PROGRAM, echo, opened, settings_in
from floods import FLOODS, Flood
from memory_group import MemoryGroup, memory_group
from responders.source_file import SourceFile
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.queue.broker import EmbeddedBroker
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.queue.processes import end_processes
from service.settings import Settings
from service.store.batches.intake import accept_batch
from service.store.engine import Store
from service.store.states import UNFINISHED, JobQueue, JobState
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Job
from sim.recording import Verdict
from submissions.grading_request import GradingRequest
from submissions.submission import Submission

MEMORY = 1_500_000_000
HONEST = """
from time import sleep
for number in range(5):
    print(f'Robot says {number}')
    print(f'PY::{number}')
    sleep(1)
"""
ECHO = "def responder(msg):\n    return msg\n"
#: Submissions that misbehave without a flood of frames, and must not affect honest students either.
OTHERS = [
    Flood("memory of a program", "held = []\nwhile True: held.append(bytearray(1 << 20))"),
    Flood("memory of a responder", PROGRAM, "import numpy\nheld = [numpy.ones(1 << 20) for _ in range(1000)]"),
    Flood("killing itself", "import os\nos.kill(os.getpid(), 9)"),
    Flood("a signal without a name", "import os\nos.kill(os.getpid(), 40)"),
    Flood("naps", "import select\nwhile True: select.select([], [], [], 0.9); print('x')"),
    Flood("digits", f"print({'1' * 20_000!r})\nprint({'1' * 20_000 + 'x'!r})"),
]


def _submission(student: str, program: str, responder: str | None) -> GradingRequest:
    parts = SourceFile("robot.py", program), SourceFile("responder.py", responder or ECHO)
    return GradingRequest(Submission(student, *parts), echo(), student)


def _honest(number: int) -> GradingRequest:
    return _submission(f"honest-{number:03}", f"# {number}\n{HONEST}", None)


def _floods(each: int, kinds: list[Flood]) -> list[GradingRequest]:
    return [
        _submission(f"flood-{place}-{number}", f"# {number}\n{kind.program}", kind.responder)
        for place, kind in enumerate(kinds)
        for number in range(each)
    ]


@contextmanager
def _worker(settings: Settings, group: MemoryGroup | None) -> Iterator[None]:
    with (settings.home / "worker.log").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "service.queue.worker"],
            env=os.environ | settings.to_environment(),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            preexec_fn=group.enter if group is not None else None,
        )
    try:
        yield
    finally:
        end_processes([process], 20)


def _run(settings: Settings, store: Store, grading_requests: list[GradingRequest], patience_seconds: float) -> str:
    """Submit the requests in one batch, in random order, and wait until all have ended; return the batch."""
    random.Random(1).shuffle(grading_requests)
    batch = accept_batch(store, "crowd", grading_requests, [], max_attempts=3).id
    with EmbeddedBroker(settings) as broker, memory_group(MEMORY) as group, _worker(broker.settings, group):
        notifier = Notifier(make_celery(broker.settings), store, broker.settings)
        notifier.grade(JobQueue.BATCH, len(grading_requests))
        until = time.monotonic() + patience_seconds
        open_jobs = select(func.count()).select_from(Job).where(Job.batch_id == batch, Job.state.in_(UNFINISHED))
        while True:
            with store.reading() as session:
                left = session.scalar(open_jobs)
            if not left:
                break
            assert time.monotonic() < until, f"{left} of {len(grading_requests)} have not ended"
            time.sleep(0.5)
        if group is not None:
            print(f"most memory {group.most_bytes >> 20} MB, processes killed for it {group.killed}")
    return batch


def _check(store: Store, batch: str, honest: int) -> None:
    with TrialRunner() as runner:
        one = _honest(0)
        right = grade(one.submission, one.assignment, runner=runner)
    query = select(Enrolment.student, Job).join(Job, Job.enrolment_id == Enrolment.id).where(Job.batch_id == batch)
    with store.reading() as session:
        rows = [(student, job) for student, job in session.execute(query)]
    assert Counter(job.state for _, job in rows) == {JobState.DONE: len(rows)}, [job.error for _, job in rows]
    marks = [(job.verdict, job.marks) for student, job in rows if student.startswith("honest")]
    assert marks == [(Verdict.FINISHED.value, Decimal(right.marks))] * honest
    floods = [job for student, job in rows if student.startswith("flood")]
    assert Verdict.HOST_ERROR.value not in {job.verdict for job in floods}


@pytest.mark.long
def test_a_few_of_every_sort_on_postgresql(tmp_path: Path, postgresql: str) -> None:
    """All floods are tested on SQLite below: what a worker keeps for a child does not depend on the database."""
    settings = settings_in(tmp_path, database_url=create_database(postgresql))
    kinds = [each for each in [*FLOODS, *OTHERS] if each.name in {"utterances", "calls", *(o.name for o in OTHERS)}]
    with opened(settings) as store:
        batch = _run(settings, store, [*map(_honest, range(15)), *_floods(1, kinds)], 240)
        _check(store, batch, 15)


@pytest.mark.long
@pytest.mark.longest
def test_a_hundred_and_fifty_among_floods_of_every_kind(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    floods = _floods(1, [*FLOODS, *OTHERS])
    with opened(settings) as store:
        batch = _run(settings, store, [*map(_honest, range(150)), *floods], 2700)
        _check(store, batch, 150)
