"""The states of a job: every transition is tried from every state, and only ``jobs.py`` writes them."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import Select, select, update
from sqlalchemy.orm import Session

import acting
import report_builders
import service
from builders import grading_request, prepared
from service.store.batches.intake import accept_batch
from service.store.engine import Store, now
from service.store.queue import jobs
from service.store.queue.job_transitions import (
    ASK_FOR,
    CANCEL,
    CLAIM,
    COPY,
    ENQUEUE,
    FINISH,
    GIVE_BACK,
    GIVE_UP,
    HEARTBEAT,
    PUT_ASIDE,
    RETRY,
    SUPERSEDE,
    TRANSITIONS,
    TRY_AGAIN,
    Transition,
)
from service.store.queue.jobs import Claim, LeaseLost, RetryPolicy
from service.store.states import CancelReason, JobState
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import HostError

WORKER = "worker"
POLICY = RetryPolicy(0.0)


@dataclass(frozen=True, slots=True)
class Subject:
    """A job in a given state, with the claim of the worker that holds it, or of one that does not."""

    job_id: str
    batch_id: str
    source_id: str  # a grade to copy
    claim: Claim


def _accept(store: Store, student: str) -> tuple[str, str]:
    batch = accept_batch(store, student, [grading_request(student)], [], max_attempts=2)
    return batch.jobs[0].job_id, batch.id


def _claimed(store: Store) -> Claim:
    claim = jobs.claim_job(store, WORKER, 60)
    assert claim is not None
    return claim


def _finish(store: Store, claim: Claim) -> None:
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))


def _fail(store: Store, claim: Claim, *, enough: bool) -> None:
    tried = Claim(claim.job_id, claim.lease, 2 if enough else 1, 2, claim.at)
    jobs.fail_job(store, tried, "it broke", POLICY)


def _in_session(change: Callable[..., object]) -> Callable[[Store, Subject], object]:
    def run(store: Store, subject: Subject) -> object:
        with store.transaction() as session:
            return change(session, subject, now(session))

    return run


def _submissions(subject: Subject) -> Select[int]:
    return select(SubmissionRow.id).where(SubmissionRow.batch_id == subject.batch_id)


def _ask_for(session: Session, subject: Subject, at: datetime) -> None:
    """Request a job as if it had been cancelled because it is over a limit."""
    session.execute(update(Job).where(Job.id == subject.job_id).values(cancelled_for=CancelReason.OVER_LIMIT))
    jobs.queue_over_limit_job(session, subject.job_id, at)


#: One action for each transition, by a caller who may do it.
MOVES: dict[Transition, Callable[[Store, Subject], object]] = {
    COPY: _in_session(lambda session, subject, at: jobs.copy_grade(session, subject.job_id, subject.source_id, at)),
    SUPERSEDE: _in_session(
        lambda session, subject, at: jobs.supersede_jobs(session, _submissions(subject), "another", at)
    ),
    CLAIM: lambda store, subject: jobs.claim_job(store, WORKER, 60),
    HEARTBEAT: lambda store, subject: jobs.renew_lease(store, subject.claim, 60, 0.5),
    FINISH: lambda store, subject: _finish(store, subject.claim),
    TRY_AGAIN: lambda store, subject: _fail(store, subject.claim, enough=False),
    GIVE_UP: lambda store, subject: _fail(store, subject.claim, enough=True),
    GIVE_BACK: lambda store, subject: jobs.release_worker(store, WORKER),
    CANCEL: _in_session(lambda session, subject, at: jobs.cancel_jobs(session, subject.batch_id, "enough", at)),
    RETRY: _in_session(lambda session, subject, at: jobs.retry_jobs(session, (Job.id == subject.job_id,), at)),
    PUT_ASIDE: _in_session(lambda session, subject, at: jobs.put_aside_job(session, subject.job_id, at)),
    ASK_FOR: _in_session(_ask_for),
}


def _subject(store: Store, state: JobState, student: str, source_id: str) -> Subject:
    """Return a job in this state, reached by the transitions themselves."""
    job_id, batch_id = _accept(store, student)
    nobodys = Claim(job_id, "0" * 32, 1, 2, datetime.now(UTC))
    if state is JobState.QUEUED:
        return Subject(job_id, batch_id, source_id, nobodys)
    claim = _claimed(store)
    assert claim.job_id == job_id
    if state is JobState.DONE:
        _finish(store, claim)
    elif state is JobState.DEAD:
        jobs.give_up_job(store, claim, "no program")
    elif state is JobState.CANCELLED:
        acting.cancel(store, batch_id)
    return Subject(job_id, batch_id, source_id, claim)


def _job(store: Store, job_id: str) -> Job:
    with store.reading() as session:
        return session.get_one(Job, job_id)


@pytest.mark.parametrize("state", JobState)
def test_a_transition_is_made_where_it_begins_and_nowhere_else(store: Store, state: JobState) -> None:
    assert set(MOVES) == set(TRANSITIONS) - {ENQUEUE}
    source_id, _ = _accept(store, "source")
    _finish(store, _claimed(store))
    for number, (transition, move) in enumerate(MOVES.items()):
        subject = _subject(store, state, f"student-{number}", source_id)
        assert _job(store, subject.job_id).state is state
        with suppress(LeaseLost, HostError):
            move(store, subject)
        job = _job(store, subject.job_id)
        assert job.state is (transition.after if state in transition.before else state), transition.name
        assert (job.lease is not None) == (job.state is JobState.RUNNING), transition.name
        assert (job.finished_at is None) == (job.state in (JobState.QUEUED, JobState.RUNNING)), transition.name
        # So that the next claim gets the next job.
        acting.cancel(store, subject.batch_id)


def test_every_state_can_be_reached_and_left_or_is_an_end() -> None:
    assert {transition.after for transition in TRANSITIONS} == set(JobState)
    left = {state for transition in TRANSITIONS for state in transition.before}
    assert set(JobState) - left == {JobState.DONE}


def test_staff_ask_for_nothing_but_what_was_put_aside(store: Store) -> None:
    subject = _subject(store, JobState.CANCELLED, "ada", "")
    with store.transaction() as session:
        assert not jobs.queue_over_limit_job(session, subject.job_id, datetime.now(UTC))
    assert _job(store, subject.job_id).state is JobState.CANCELLED


def test_the_drawing_names_every_transition() -> None:
    drawn = Path(service.__file__ or "").parents[1].joinpath("docs", "how-it-works.md").read_text(encoding="utf-8")
    section = drawn.split("## A job", 1)[1].split("\n## ", 1)[0]
    rows = {tuple(cell.strip(" `") for cell in line.split("|")[1:-1]) for line in section.splitlines() if "|" in line}
    for transition in TRANSITIONS:
        before = ", ".join(state.value for state in transition.before)
        assert (transition.name, before, transition.after.value, transition.by) in rows


#: The columns that form a job's state.
OWN = {"state", "lease", "lease_until", "due_at"}


def _imported(source: str) -> set[str]:
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom | ast.Import))
    return {alias.name for node in nodes for alias in node.names}


def _job_writes(tree: ast.AST) -> Iterator[int]:
    """Yield the lines that write a job's state, or could. Values that are not constant here count."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in [each for outer in targets for each in ast.walk(outer)]:
                if (
                    isinstance(target, ast.Attribute)
                    and isinstance(target.ctx, ast.Store)
                    and target.attr in OWN
                    and not (isinstance(target.value, ast.Name) and target.value.id in ("self", "row"))
                ):
                    yield node.lineno
        elif isinstance(node, ast.Dict):
            written = {key.value for key in node.keys if isinstance(key, ast.Constant)}
            if written & (OWN - {"state"}):
                yield node.lineno
        elif isinstance(node, ast.Call) and _writes_a_job(node):
            yield node.lineno


def _writes_a_job(call: ast.Call) -> bool:
    """Return whether the call creates a job, or writes such columns without naming another table."""
    if not any(keyword.arg is None or keyword.arg in OWN for keyword in call.keywords):
        return False
    if isinstance(call.func, ast.Name):
        return call.func.id == "Job"
    if not isinstance(call.func, ast.Attribute) or call.func.attr != "values":
        return False
    others = ("update(Batch)", "update(Delivery)", "update(IdempotentReply)", "insert(")
    return not ast.unparse(call.func.value).startswith(others)


@pytest.mark.parametrize(
    "written",
    [
        "job.state = JobState.DONE",
        "job.state, job.lease = JobState.QUEUED, None",
        "job = Job(id=job_id, state=JobState.DONE)",
        "session.execute(update(Job).where(Job.id == job_id).values(state=JobState.DONE))",
        "session.execute(update(Job).values(**values))",
        "waiting = update(Job)\nsession.execute(waiting.values(due_at=at))",
        "columns = {'lease': None}",
    ],
)
def test_a_write_of_a_state_would_be_found(written: str) -> None:
    assert list(_job_writes(ast.parse(written)))


#: The modules that write them, and the module of test runs, which are not jobs and have their own states.
_WRITERS, _TEST_RUNS = ("store/queue/jobs.py", "store/queue/job_transitions.py"), "store/queue/test_runs.py"


@pytest.mark.long
def test_nothing_else_writes_the_state_of_a_job() -> None:
    folder = Path(service.__file__ or "").parent
    assert "Job" not in _imported((folder / _TEST_RUNS).read_text(encoding="utf-8"))
    writers = {
        f"{path.relative_to(folder)}:{line}"
        for path in sorted(folder.rglob("*.py"))
        if path.relative_to(folder).as_posix() not in (*_WRITERS, _TEST_RUNS) and "versions" not in path.parts
        for line in _job_writes(ast.parse(path.read_text(encoding="utf-8")))
    }
    assert writers == set()
