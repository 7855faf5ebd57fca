"""Test runs: one trial that is fully visible to students, with separate limits, and a report."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from dataclasses import replace

import pytest

from builders import echo, grading_request
from service.grading.trial_runner import TrialRunner
from service.queue.trying import try_next
from service.settings import Settings
from service.store.courses.versions import freeze, keep
from service.store.engine import Store, now
from service.store.people.students import Students, course_of
from service.store.queue import tryouts
from service.store.queue.tryouts import TryoutLine
from service.store.states import TryoutState
from service.trying import LONGEST_SECONDS, tryout_assignment
from sim.errors import HostError
from submissions.assignment.definition import Assignment, Scenario, Visibility
from submissions.assignment.limits import Limits
from submissions.assignment.reader import find_assignment
from submissions.packed import pack_submission
from submissions.seeds import Secret
from submissions.student_identity import Student

HIDDEN = "hidden-place"


@pytest.fixture(scope="module")
def runner() -> Iterator[TrialRunner]:
    with TrialRunner() as made:
        yield made


def _with_hidden(asked: Assignment) -> Assignment:
    hidden = replace(asked.scenarios[0], id=HIDDEN, visibility="hidden")
    return replace(asked, scenarios=(hidden, *asked.scenarios), secret="do not tell")


def _tried(
    store: Store, runner: TrialRunner, program: str, asked: Assignment | None = None, *, alone: bool = False
) -> TryoutLine:
    """Return the student's view of a test run after a worker was notified; with ``alone``, without a responder."""
    submission = grading_request("ada", program).submission
    packed = pack_submission(replace(submission, responder=None) if alone else submission)
    frozen = freeze(asked or _with_hidden(echo()))
    with store.transaction() as session:
        at = now(session)
        ada = Students(session, course_of(session, "default", at)).enrol(Student("ada"), at)
        made = tryouts.ask(session, ada, keep(session, frozen, at), packed)
    try_next(store, Settings(), runner)
    with store.reading() as session:
        line = tryouts.line(session, ada, made)
    assert line is not None
    return line


def test_nothing_of_the_trial_is_secret() -> None:
    once = tryout_assignment(_with_hidden(echo()))
    assert once is not None
    assert [each.id for each in once.scenarios] == [echo().scenarios[0].id]
    assert HIDDEN not in repr(once)
    assert "do not tell" not in repr(once)
    other = tryout_assignment(replace(_with_hidden(echo()), secret="another"))
    assert other is not None
    assert list(once.trials()) == list(other.trials())
    assert [trial.seed for trial in once.trials()] != [trial.seed for trial in echo().trials(Secret("installation's"))]


def test_it_is_one_short_trial_of_many() -> None:
    asked = find_assignment("shape-recognition")
    assert len(list(asked.trials())) > 1
    once = tryout_assignment(replace(asked, limits=Limits(program_cpu=60, responder_cpu=60, all_cpu=600)))
    assert once is not None
    (trial,) = once.trials()
    assert trial.pose == asked.scenarios[0].poses[0]
    assert trial.scenario.seconds <= LONGEST_SECONDS
    assert (once.limits.program_cpu, once.limits.all_cpu) < (5, 20)
    small = tryout_assignment(replace(asked, limits=Limits(program_cpu=0.5)))
    assert small is not None
    assert small.limits.program_cpu == 0.5


@pytest.mark.parametrize("hidden", ["hidden", "after_published"])
def test_where_students_see_no_robot_there_is_nothing_to_try(hidden: Visibility) -> None:
    scenarios: tuple[Scenario, ...] = tuple(replace(each, visibility=hidden) for each in echo().scenarios)
    assert tryout_assignment(replace(echo(), scenarios=scenarios)) is None
    assert tryout_assignment(find_assignment("train-a-recogniser")) is None


def test_what_it_said_and_where_it_failed_is_told_and_played(store: Store, runner: TrialRunner) -> None:
    line = _tried(store, runner, "print('PY::hello')\nimport time\ntime.sleep(1)\nprint(undefined)\n")
    assert (line.state, line.error) == (TryoutState.DONE, "")
    assert [text for _, text in line.words["lines"]] == ["PY::hello", "(answer) PY::hello"]
    assert line.words["faults"][0]["message"] == "NameError: name 'undefined' is not defined"
    assert line.words["failed"] == "#trial=1&t=1.000"
    with store.reading() as session:
        replay = json.loads(zlib.decompress(tryouts.replay_of(session, line.id) or b""))
    assert len(replay["trials"]) == 1
    assert HIDDEN not in json.dumps(replay)


def test_endless_output_and_endless_loops_end(store: Store, runner: TrialRunner) -> None:
    line = _tried(store, runner, "import time\nwhile True:\n    print('x' * 1000)\n    time.sleep(0.01)\n")
    assert line.state is TryoutState.DONE
    assert len(json.dumps(line.words)) < 400_000
    assert line.words["more_lines"] > 0


def test_of_a_part_that_is_not_there_no_marks_are_spoken(store: Store, runner: TrialRunner) -> None:
    line = _tried(store, runner, "import time\nprint('PY::1')\ntime.sleep(1)\n", echo(), alone=True)
    told = json.dumps(line.words)
    assert "There is no responder.py, so only the other part was run." in line.words["notes"]
    assert "graded" not in told
    assert "marks" not in told
    assert "(answer of the simulator) pingpong PY::1" in told


def test_a_fault_of_ours_is_no_verdict(store: Store, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise HostError("the disk /dev/secret is full")

    monkeypatch.setattr("service.queue.trying.run_tryout", broken)
    line = _tried(store, runner, "print(1)\n")
    assert line.state is TryoutState.QUEUED
    assert not try_next(store, Settings(), runner)
    with store.reading() as session:
        again = tryouts.line(session, 1, line.id)
    assert again is not None
    assert again.state is TryoutState.FAILED
    assert "secret" not in again.error
