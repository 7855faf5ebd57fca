"""Test runs: one trial that is fully visible to students, with separate limits, and a report."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from dataclasses import replace

import pytest

from builders import echo, grading_request
from service.grading.trial_runner import TrialRunner
from service.queue.test_run_job import run_next_test
from service.settings import Settings
from service.store.courses.assignment_versions import freeze_assignment, store_version
from service.store.engine import Store, now
from service.store.people.students import Students, ensure_course
from service.store.queue import test_runs
from service.store.queue.test_runs import StudentTestRun
from service.store.states import RunState
from service.test_runs import MAX_SECONDS, build_single_trial_assignment
from sim.errors import HostError
from submissions.assignment.definition import Assignment, Scenario, Visibility
from submissions.assignment.limits import Limits
from submissions.assignment.reader import find_assignment
from submissions.seeds import Secret
from submissions.stored_submission import pack_submission
from submissions.student_identity import Student

HIDDEN = "hidden-place"


@pytest.fixture(scope="module")
def runner() -> Iterator[TrialRunner]:
    with TrialRunner() as made:
        yield made


def _with_hidden(assignment: Assignment) -> Assignment:
    hidden = replace(assignment.scenarios[0], id=HIDDEN, visibility="hidden")
    return replace(assignment, scenarios=(hidden, *assignment.scenarios), secret="do not tell")


def _tried(
    store: Store, runner: TrialRunner, program: str, assignment: Assignment | None = None, *, alone: bool = False
) -> StudentTestRun:
    """Return the student's view of a test run after a worker was notified; with ``alone``, without a responder."""
    submission = grading_request("ada", program).submission
    packed = pack_submission(replace(submission, responder=None) if alone else submission)
    frozen = freeze_assignment(assignment or _with_hidden(echo()))
    with store.transaction() as session:
        at = now(session)
        ada = Students(session, ensure_course(session, "default", at)).enrol(Student("ada"), at)
        made = test_runs.queue_test_run(session, ada, store_version(session, frozen, at), packed)
    run_next_test(store, Settings(), runner)
    with store.reading() as session:
        line = test_runs.find_student_run(session, ada, made)
    assert line is not None
    return line


def test_nothing_of_the_trial_is_secret() -> None:
    once = build_single_trial_assignment(_with_hidden(echo()))
    assert once is not None
    assert [each.id for each in once.scenarios] == [echo().scenarios[0].id]
    assert HIDDEN not in repr(once)
    assert "do not tell" not in repr(once)
    other = build_single_trial_assignment(replace(_with_hidden(echo()), secret="another"))
    assert other is not None
    assert list(once.trials()) == list(other.trials())
    assert [trial.seed for trial in once.trials()] != [trial.seed for trial in echo().trials(Secret("installation's"))]


def test_it_is_one_short_trial_of_many() -> None:
    assignment = find_assignment("shape-recognition")
    assert len(list(assignment.trials())) > 1
    once = build_single_trial_assignment(
        replace(assignment, limits=Limits(program_cpu=60, responder_cpu=60, all_cpu=600))
    )
    assert once is not None
    (trial,) = once.trials()
    assert trial.pose == assignment.scenarios[0].poses[0]
    assert trial.scenario.seconds <= MAX_SECONDS
    assert (once.limits.program_cpu, once.limits.all_cpu) < (5, 20)
    small = build_single_trial_assignment(replace(assignment, limits=Limits(program_cpu=0.5)))
    assert small is not None
    assert small.limits.program_cpu == 0.5


@pytest.mark.parametrize("hidden", ["hidden", "after_published"])
def test_where_students_see_no_robot_there_is_nothing_to_try(hidden: Visibility) -> None:
    scenarios: tuple[Scenario, ...] = tuple(replace(each, visibility=hidden) for each in echo().scenarios)
    assert build_single_trial_assignment(replace(echo(), scenarios=scenarios)) is None
    assert build_single_trial_assignment(find_assignment("train-a-recogniser")) is None


def test_what_it_said_and_where_it_failed_is_told_and_played(store: Store, runner: TrialRunner) -> None:
    line = _tried(store, runner, "print('PY::hello')\nimport time\ntime.sleep(1)\nprint(undefined)\n")
    assert (line.state, line.error) == (RunState.DONE, "")
    assert [text for _, text in line.words["lines"]] == ["PY::hello", "(answer) PY::hello"]
    assert line.words["faults"][0]["message"] == "NameError: name 'undefined' is not defined"
    assert line.words["failed"] == "#trial=1&t=1.000"
    with store.reading() as session:
        replay = json.loads(zlib.decompress(test_runs.load_replay(session, line.id) or b""))
    assert len(replay["trials"]) == 1
    assert HIDDEN not in json.dumps(replay)


def test_endless_output_and_endless_loops_end(store: Store, runner: TrialRunner) -> None:
    line = _tried(store, runner, "import time\nwhile True:\n    print('x' * 1000)\n    time.sleep(0.01)\n")
    assert line.state is RunState.DONE
    assert len(json.dumps(line.words)) < 400_000
    assert line.words["more_lines"] > 0


def test_of_a_part_that_is_not_there_no_marks_are_spoken(store: Store, runner: TrialRunner) -> None:
    line = _tried(store, runner, "import time\nprint('PY::1')\ntime.sleep(1)\n", echo(), alone=True)
    output = json.dumps(line.words)
    assert "There is no responder.py, so only the other part was run." in line.words["notes"]
    assert "graded" not in output
    assert "marks" not in output
    assert "(answer of the simulator) pingpong PY::1" in output


def test_a_fault_of_ours_is_no_verdict(store: Store, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise HostError("the disk /dev/secret is full")

    monkeypatch.setattr("service.queue.test_run_job.execute_test_run", broken)
    line = _tried(store, runner, "print(1)\n")
    assert line.state is RunState.QUEUED
    assert not run_next_test(store, Settings(), runner)
    with store.reading() as session:
        again = test_runs.find_student_run(session, 1, line.id)
    assert again is not None
    assert again.state is RunState.FAILED
    assert "secret" not in again.error
