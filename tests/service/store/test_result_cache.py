"""An identical submission is not run again: it gets the earlier grade, marked as a copy, if that can be trusted."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import pytest
from sqlalchemy import update

import report_builders
from builders import comparable, echo, grading_request
from responders.sandbox.meter import JobCosts, JobLimits
from service.commands.batch.batch_summary import list_remarks
from service.grading.grade import Cost, Grade
from service.store import artifacts
from service.store.batches import job_lines
from service.store.batches.intake import AcceptedSubmission, accept_batch, accept_submission
from service.store.engine import Store
from service.store.grades import plots, results
from service.store.installation import load_secret
from service.store.queue import jobs, metrics, self_tests
from service.store.states import JobState, PlotState, Standing
from service.store.tables.submissions import Job
from sim.recording import Verdict
from submissions.grading_request import GradingRequest
from submissions.seeds import Secret

SANDBOX = "Landlock 7, seccomp, process limits, policy 0"
GRADE = replace(report_builders.shape_grade(), sandbox=SANDBOX)


def _accept(store: Store, student: str = "ada", like: GradingRequest | None = None) -> AcceptedSubmission:
    taken = like or grading_request()
    submission = replace(taken.submission, student=student)
    return accept_submission(store, replace(taken, submission=submission), max_attempts=3)


def _grade_next(store: Store, grade: Grade = GRADE, worker: str = "worker") -> str:
    claim = jobs.claim_job(store, worker, 60)
    assert claim is not None
    own = replace(grade, secret_sha256=load_secret(store).sha256)
    jobs.finish_job(store, claim, results.prepare_grade(own), datetime.now(UTC))
    return claim.job_id


def _job(store: Store, job_id: str) -> Job:
    with store.reading() as session:
        return session.get_one(Job, job_id)


def test_an_identical_submission_has_the_grade_at_once_and_says_whose(store: Store) -> None:
    cost = Cost(JobLimits(), JobCosts(4000, 3.25, 0.5))
    _accept(store, "ada")
    first = _grade_next(store, replace(GRADE, cost=cost))
    plots.store_plots(store, first, {"a": b"image"})
    second = _accept(store, "bob")
    assert second.copied_from == first
    job = _job(store, second.job_id)
    assert (job.state, job.copied_from, job.plots, job.attempt) == (JobState.DONE, first, PlotState.DONE, 0)
    assert jobs.claim_job(store, "worker", 60) is None
    with store.reading() as session:
        original, copy = results.load_grade(session, first), results.load_grade(session, second.job_id)
        assert comparable(replace(copy, student=original.student)) == comparable(original)
        assert copy.cost == original.cost == cost
        assert artifacts.load_files(session, second.job_id, prefix="plot-")["plot-a.png"].data == b"image"
        assert job_lines.load_job_line(session, second.job_id).copied_from == first
    # Copies of copies do not exist: the source is always the grade that was run.
    assert _accept(store, "eve").copied_from == first


def test_a_copy_tells_how_its_own_files_were_read_and_not_anothers(store: Store) -> None:
    def of(student: str) -> GradingRequest:
        taken = grading_request()
        return replace(taken, submission=replace(taken.submission, notes=(f"read from the folder {student} King",)))

    _accept(store, "ada", of("Ada"))
    first = _grade_next(store, replace(GRADE, notes=("read from the folder Ada King", "the program has no magic line")))
    second = _accept(store, "bob", of("Bob"))
    assert second.copied_from == first
    assert _job(store, second.job_id).notes == ["read from the folder Bob King", "the program has no magic line"]


def test_what_waits_is_copied_when_its_turn_comes(store: Store) -> None:
    ids = [_accept(store, student).job_id for student in ("ada", "bob")]
    first = _grade_next(store)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    assert jobs.finish_job_from_cache(store, claim)
    assert {first, claim.job_id} == set(ids)
    assert (_job(store, claim.job_id).copied_from, _job(store, claim.job_id).plots) == (first, PlotState.DUE)
    with pytest.raises(jobs.LeaseLost):
        jobs.finish_job_from_cache(store, claim)


def test_what_could_not_be_judged_is_told_and_never_copied(store: Store) -> None:
    criteria = (replace(GRADE.criteria[0], unjudged="it took more than 11 s of computing"), *GRADE.criteria[1:])
    _accept(store, "ada")
    first = _grade_next(store, replace(GRADE, criteria=criteria))
    with store.reading() as session:
        assert results.load_grade(session, first).criteria[0].unjudged == criteria[0].unjudged
        line = job_lines.load_job_line(session, first)
        assert metrics.collect_service_metrics(session).unjudged == 1
    assert "1 criteria not judged" in list_remarks(line)
    assert _accept(store, "bob").copied_from is None


def test_what_is_asked_for_anew_is_run(store: Store) -> None:
    _accept(store, "ada")
    _grade_next(store)
    accept_batch(store, "again", [grading_request("ada")], [], max_attempts=3)
    claim = jobs.claim_job(store, "worker", 60)
    assert claim is not None
    assert not jobs.finish_job_from_cache(store, claim)


@pytest.mark.parametrize(
    "other",
    [grading_request("bob", "print('other')\n"), grading_request("bob", assignment=replace(echo(), title="Another"))],
    ids=["other bytes", "other assignment"],
)
def test_only_the_identical_is_copied(store: Store, other: GradingRequest) -> None:
    _accept(store, "ada")
    _grade_next(store)
    assert _accept(store, "bob", other).copied_from is None


def _cut(verdict: Verdict) -> Grade:
    (trial, *rest) = GRADE.trials
    return replace(GRADE, trials=(replace(trial, recording=replace(trial.recording, verdict=verdict)), *rest))


@pytest.mark.parametrize(
    "grade",
    [replace(GRADE, sandbox="process limits only"), _cut(Verdict.CPU_LIMIT), _cut(Verdict.STALLED)],
    ids=["without the sandbox", "cut by the machine", "stalled"],
)
def test_what_cannot_be_relied_on_is_run_again(store: Store, grade: Grade) -> None:
    _accept(store, "ada")
    _grade_next(store, grade)
    assert _accept(store, "bob").copied_from is None


def test_another_grader_runs_it_again(store: Store) -> None:
    _accept(store, "ada")
    first = _grade_next(store)
    with store.transaction() as session:
        session.execute(update(Job).where(Job.id == first).values(cache_key="0" * 64))
    assert _accept(store, "bob").copied_from is None


def test_another_secret_runs_it_again(store: Store) -> None:
    _accept(store, "ada")
    first = _grade_next(store)
    other = Store(store.engine, Secret("what the environment has"))
    assert _accept(other, "bob").copied_from is None
    assert _accept(store, "eve").copied_from == first


def test_copies_of_a_suspect_grade_are_suspect_and_run_again(store: Store) -> None:
    _accept(store, "ada")
    first = _grade_next(store, worker="wrong")
    second = _accept(store, "bob").job_id
    done = self_tests.quarantine_worker(store, "wrong", "it adds wrongly")
    assert (set(done.suspect), len(done.again)) == ({first, second}, 2)
    assert _job(store, second).standing is Standing.KEPT
    assert _accept(store, "eve").copied_from is None
    again = _grade_next(store, worker="right")
    claim = jobs.claim_job(store, "right", 60)
    assert claim is not None
    assert jobs.finish_job_from_cache(store, claim)
    assert _job(store, claim.job_id).copied_from == again
