"""A process of a worker checks itself: it grades a submission whose recordings' hashes and marks are known.

What follows from a wrong answer is ``service.store.queue.self_tests``'s; this module only asks the question.
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
from service.queue.right_answers import QUESTION, RightAnswer
from service.store.engine import Store
from service.store.queue import self_tests
from sim.recording import Verdict
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission
from submissions.submission import Submission

_log = structlog.get_logger(__name__)
_ANSWER = QUESTION / "answer.json"
#: How long a process that was spared the question at its start may work before it is asked.
_SOON_SECONDS = 30.0
#: A trial that ended so was cut by the machine or its load, and says nothing of the simulator.
_CUT = frozenset({Verdict.HOST_ERROR, Verdict.CPU_LIMIT, Verdict.MEMORY_LIMIT, Verdict.STALLED})


class SelfTestAnswer(Enum):
    """What came of a look."""

    RIGHT = "right"
    WRONG = "wrong"
    UNCLEAR = "unclear"  # the machine could not grade it; that accuses nobody


@dataclass(frozen=True, slots=True)
class KnownAnswer:
    """What grading the known submission gives: the marks and the hash of each trial's recording."""

    marks: str
    chains: tuple[str, ...]


def known() -> KnownAnswer:
    """What a worker must find."""
    told = json.loads(_ANSWER.read_text(encoding="utf-8"))
    return KnownAnswer(told["marks"], tuple(told["chains"]))


def ask(runner: TrialRunner) -> KnownAnswer | None:
    """What this process finds; None when a limit of the machine cut it. Raises HostError when it cannot grade."""
    submission, assignment = _question()
    graded = grade(submission, assignment, runner=runner)
    cut = any(trial.verdict in _CUT for trial in graded.trials) or any(result.unjudged for result in graded.criteria)
    return None if cut else found(graded)


def found(graded: Grade) -> KnownAnswer:
    """The marks of a grade, and the hash of each trial's recording."""
    return KnownAnswer(str(graded.marks), tuple(trial.recording.sha256 for trial in graded.trials))


def difference(expected: KnownAnswer, actual: KnownAnswer) -> str:
    """One sentence; empty where they are the same."""
    if actual.chains != expected.chains:
        pairs = zip(expected.chains, actual.chains, strict=False)
        number = next((i for i, (ours, theirs) in enumerate(pairs, 1) if ours != theirs), len(expected.chains))
        return (
            f"trial {number} of the known answer has another hash than it must: "
            f"{_start(actual, number)} instead of {_start(expected, number)}"
        )
    if actual.marks != expected.marks:
        return f"the known answer got {actual.marks} marks instead of {expected.marks}"
    return ""


class Watch:
    """Looks after one process of a worker: at its start, before a job when it is time, and while it has none.

    Grading and looking take turns; whoever grades holds ``busy``.
    """

    def __init__(
        self, store: Store, runner: TrialRunner, worker: str, every_seconds: float, right: RightAnswer | None = None
    ) -> None:
        """``right`` is where a right answer is written down for those that start later."""
        self._right = right
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
        """For as long as a job is graded; looks first if it is time. What is found wrong stops the claim itself."""
        with self._lock:
            if time.monotonic() >= self._next:
                self._look()
            yield

    def begin(self) -> None:
        """Look now; or soon, where this build has answered rightly on this machine not long ago, or does now."""
        with nullcontext() if self._right is None else self._right.alone():
            if self._right is not None and self._right.given:
                self._next = time.monotonic() + min(self._every, _SOON_SECONDS)
            else:
                self.look()

    def look(self) -> SelfTestAnswer:
        """Grade the known answer now, and write down what came of it."""
        with self._lock:
            return self._look()

    def keep_looking(self) -> None:
        """Look again and again from a thread that lives as long as the process, so that idleness hides nothing."""
        if self._thread is None:
            self._thread = Thread(target=self._run, name="self_test", daemon=True)
            self._thread.start()

    def end(self) -> None:
        """Look no more."""
        self._ended.set()
        with self._lock:
            self._next = float("inf")

    def _run(self) -> None:
        while not self._ended.wait(max(0.1, self._next - time.monotonic())):
            with self._lock:
                if not self._ended.is_set() and time.monotonic() >= self._next:
                    self._look()

    def _look(self) -> SelfTestAnswer:
        self._next = time.monotonic() + self._every
        try:
            actual = ask(self._runner)
            if actual is None:
                _log.warning("self_test.unclear", reason="it was cut by a limit of this machine")
                return SelfTestAnswer.UNCLEAR
            wrong = difference(known(), actual)
            if not wrong:
                self_tests.answered_rightly(self._store, self._worker, os.getpid())
                if self._right is not None:
                    self._right.note()
                return SelfTestAnswer.RIGHT
            if self._right is not None:
                self._right.forget()
            spoilt = self_tests.quarantine(self._store, self._worker, wrong)
        except Exception:
            # Trouble with the machine or the database shows in the jobs themselves.
            _log.exception("self_test.unclear")
            return SelfTestAnswer.UNCLEAR
        _log.error(
            "worker.quarantined",
            worker=self._worker,
            reason=wrong,
            suspect_grades=len(spoilt.suspect),
            graded_again=len(spoilt.again),
            taken_back=spoilt.taken_back,
        )
        return SelfTestAnswer.WRONG


@cache
def _question() -> tuple[Submission, Assignment]:
    assignment = read_assignment(QUESTION)
    return read_submission(QUESTION / "submission", asked=assignment.parts), assignment


def _start(answer: KnownAnswer, number: int) -> str:
    return answer.chains[number - 1][:12] if number <= len(answer.chains) else "none"


def write_answer() -> None:
    """Write down as known what this checkout finds; for whoever changes the simulator on purpose."""
    with TrialRunner() as runner:
        actual = ask(runner)
    if actual is None:
        raise SystemExit("the machine cut the trials; try again")
    text = json.dumps({"marks": actual.marks, "chains": actual.chains}, indent=2)
    _ANSWER.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    write_answer()
