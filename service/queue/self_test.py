"""Self-test of a worker process: it grades a submission with known marks and recording hashes.

``service.store.queue.self_tests`` handles the result; this module only runs the test.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from enum import Enum
from functools import cache
from threading import Event, Lock, Thread

import structlog

from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.queue.self_test_record import KNOWN_ANSWER_FOLDER, SelfTestRecord
from service.store.engine import Store
from service.store.queue import self_tests
from sim.recording import Verdict
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission
from submissions.submission import Submission

_log = structlog.get_logger(__name__)
_ANSWER_FILE = KNOWN_ANSWER_FOLDER / "answer.json"
#: Maximum delay of the first self-test if it was skipped at start-up.
_MAX_FIRST_DELAY_SECONDS = 30.0
#: A trial with such an end was cut short by the machine or its load, and is not evidence against the simulator.
_CUT_SHORT_VERDICTS = frozenset({Verdict.HOST_ERROR, Verdict.CPU_LIMIT, Verdict.MEMORY_LIMIT, Verdict.STALLED})


class SelfTestResult(Enum):
    """The result of a self-test."""

    RIGHT = "right"
    WRONG = "wrong"
    UNCLEAR = "unclear"  # the machine could not grade it, which counts against no worker


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """The expected result of the known submission: its marks and the hash of each trial's recording."""

    marks: str
    chains: tuple[str, ...]


def load_known_answer() -> KnownAnswer:
    """Return the expected result."""
    document = json.loads(_ANSWER_FILE.read_text(encoding="utf-8"))
    return KnownAnswer(document["marks"], tuple(document["chains"]))


def run_self_test(runner: TrialRunner) -> KnownAnswer | None:
    """Grade the known submission; None if a limit of the machine cut it short. Raises HostError if grading fails."""
    submission, assignment = _load_question()
    actual_grade = grade(submission, assignment, runner=runner)
    is_cut_short = any(trial.verdict in _CUT_SHORT_VERDICTS for trial in actual_grade.trials) or any(
        result.unjudged for result in actual_grade.criteria
    )
    return None if is_cut_short else extract_answer(actual_grade)


def extract_answer(actual_grade: Grade) -> KnownAnswer:
    """Return the marks of a grade, and the hash of each trial's recording."""
    return KnownAnswer(str(actual_grade.marks), tuple(trial.recording.sha256 for trial in actual_grade.trials))


def describe_difference(expected: KnownAnswer, actual: KnownAnswer) -> str:
    """Return a sentence that describes the difference; empty if there is none."""
    if actual.chains != expected.chains:
        pairs = zip(expected.chains, actual.chains, strict=False)
        number = next((i for i, (ours, theirs) in enumerate(pairs, 1) if ours != theirs), len(expected.chains))
        return (
            f"trial {number} of the known answer has hash {_format_hash_start(actual, number)}, expected "
            f"{_format_hash_start(expected, number)}"
        )
    if actual.marks != expected.marks:
        return f"the known answer got {actual.marks} marks, expected {expected.marks}"
    return ""


class SelfTester:
    """Self-tests of one worker process: at start-up, before a job when one is due, and while idle.

    Grading and self-tests exclude each other: use ``busy`` while grading.
    """

    def __init__(
        self, store: Store, runner: TrialRunner, worker: str, every_seconds: float, record: SelfTestRecord | None = None
    ) -> None:
        """Create a watch. ``record`` records a pass for processes that start later."""
        self._right = record
        self._store = store
        self._runner = runner
        self._worker = worker
        self._every = every_seconds
        self._next = 0.0
        self._lock = Lock()
        self._ended = Event()
        self._thread: Thread | None = None

    @contextmanager
    def busy(self) -> Iterator[None]:
        """Block self-tests while a job is graded, after running one that is due. A failed test prevents the claim."""
        with self._lock:
            if time.monotonic() >= self._next:
                self._look()
            yield

    def begin(self) -> None:
        """Run the self-test now, or soon if this build has passed recently on this machine."""
        with nullcontext() if self._right is None else self._right.alone():
            if self._right is not None and self._right.given:
                self._next = time.monotonic() + min(self._every, _MAX_FIRST_DELAY_SECONDS)
            else:
                self.look()

    def look(self) -> SelfTestResult:
        """Run the self-test now and store its result."""
        with self._lock:
            return self._look()

    def repeat_in_thread(self) -> None:
        """Repeat the self-test from a thread until the process ends, so that idle workers are tested, too."""
        if self._thread is None:
            self._thread = Thread(target=self._run, name="self_test", daemon=True)
            self._thread.start()

    def end(self) -> None:
        """Stop the self-tests."""
        self._ended.set()
        with self._lock:
            self._next = float("inf")

    def _run(self) -> None:
        while not self._ended.wait(max(0.1, self._next - time.monotonic())):
            with self._lock:
                if not self._ended.is_set() and time.monotonic() >= self._next:
                    self._look()

    def _look(self) -> SelfTestResult:
        self._next = time.monotonic() + self._every
        try:
            actual = run_self_test(self._runner)
            if actual is None:
                _log.warning("self_test.unclear", reason="it was stopped by a limit of this machine")
                return SelfTestResult.UNCLEAR
            difference = describe_difference(load_known_answer(), actual)
            if not difference:
                self_tests.record_pass(self._store, self._worker, os.getpid())
                if self._right is not None:
                    self._right.note()
                return SelfTestResult.RIGHT
            if self._right is not None:
                self._right.forget()
            quarantine = self_tests.quarantine_worker(self._store, self._worker, difference)
        except Exception:
            # Problems with the machine or the database are visible in the jobs themselves.
            _log.exception("self_test.unclear")
            return SelfTestResult.UNCLEAR
        _log.error(
            "worker.quarantined",
            worker=self._worker,
            reason=difference,
            suspect_grades=len(quarantine.suspect),
            graded_again=len(quarantine.again),
            taken_back=quarantine.taken_back,
        )
        return SelfTestResult.WRONG


@cache
def _load_question() -> tuple[Submission, Assignment]:
    assignment = read_assignment(KNOWN_ANSWER_FOLDER)
    return read_submission(KNOWN_ANSWER_FOLDER / "submission", required_parts=assignment.parts), assignment


def _format_hash_start(answer: KnownAnswer, number: int) -> str:
    return answer.chains[number - 1][:12] if number <= len(answer.chains) else "none"


def write_known_answer() -> None:
    """Store the result of this checkout as expected, after an intended change of the simulator."""
    with TrialRunner() as runner:
        actual = run_self_test(runner)
    if actual is None:
        raise SystemExit("a limit of this machine stopped the trials; try again")
    text = json.dumps({"marks": actual.marks, "chains": actual.chains}, indent=2)
    _ANSWER_FILE.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    write_known_answer()
