"""Judging within limits: small inputs are judged directly, others in a process that is killed at its limits.

``judge.py`` has the judging itself. A criterion that exceeds its limits does not affect others, and the search for
hints (``hints.py``) does not affect marks.
"""

from __future__ import annotations

import gc
import io
import os
import pickle
import resource
import select
import signal
import struct
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn

from service.grading.grade import CriterionResult, TrialResult
from service.grading.judging.judge import judge_one, order_criteria, reject_failed_trials
from service.grading.judging.judge_declaration import Case, StaticAnalysis
from sim.errors import HostError, RobomarkError
from sim.recording import Image
from sim.sentences import Sentence
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion

#: Largest number of characters written in all trials for direct judging. Forking costs about as much as judging them.
_SMALL_INPUT = 100_000
_CHARACTERS_PER_TEXT = 20  # characters added per text
_HEARTBEAT_MILLISECONDS = 200
_MAX_CAUSE_LENGTH = 300
_FRAME = struct.Struct("<Q")
_IMAGE = "IMG_DATA::"
#: Only its limits or its parent end the child. A signal that stops the service must not count as a judging failure.
_IGNORED_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_LIMIT_SIGNALS = (signal.SIGPROF, signal.SIGALRM)


@dataclass(frozen=True, slots=True)
class JudgingLimits:
    """Limits of judging: CPU seconds, wall-clock seconds, and bytes beyond those already mapped."""

    cpu_seconds: float
    seconds: float
    memory_bytes: int


#: For all criteria together if there is little to judge, and for hints.
_SMALL_LIMITS = JudgingLimits(2.0, 10.0, 256 << 20)


def compute_judging_limits(trials: Sequence[TrialResult]) -> JudgingLimits:
    """Return the limits for each criterion: at least ten times the needs of the longest texts and runs."""
    ticks = sum(len(trial.recording.ticks) for trial in trials)
    cpu_seconds = 10 + len(trials) + ticks / 5000
    return JudgingLimits(cpu_seconds, 6 * cpu_seconds, 512 << 20)


def judge_within_limits(
    bounds: JudgingLimits,
    assignment: Assignment,
    trials: tuple[TrialResult, ...],
    analysis: StaticAnalysis,
    heartbeat: Callable[[], None] = lambda: None,
) -> tuple[CriterionResult, ...]:
    """Judge like ``judge``. The result of a criterion that could not be judged says so, with the reason.

    Raises:
        HostError: As for ``judge``, or if no process can be started.
        Exception: Whatever ``heartbeat`` raises.
    """
    reject_failed_trials(trials)
    remaining_criteria = order_criteria(assignment)
    results: dict[str, CriterionResult] = {}
    case = Case(assignment, trials, analysis, results)
    if _is_small(trials):
        # The process below finds any problem again.
        with suppress(Exception, _TimeLimitExpired), _guarded():
            while remaining_criteria:
                results[remaining_criteria[0].id] = judge_one(remaining_criteria[0], case)
                del remaining_criteria[0]
    killed_at = ""
    while remaining_criteria:
        judging = _JudgingProcess(bounds, case, results)
        frames, status = _run_in_process(lambda: judging.judge_criteria(remaining_criteria), heartbeat)  # noqa: B023 - called at once
        for frame in frames:
            result: CriterionResult = _Unpickler(io.BytesIO(frame), trials).load()
            results[result.id] = result
        del remaining_criteria[: len(frames)]
        if not remaining_criteria:
            break
        # Killed from outside, for example when the machine is out of memory. Once, this may not be the criterion's
        # fault.
        if _find_ending_signal(status) == signal.SIGKILL and killed_at != remaining_criteria[0].id:
            killed_at = remaining_criteria[0].id
            continue
        criterion = remaining_criteria.pop(0)
        results[criterion.id] = _build_unjudged_result(criterion, _describe_cause(status, bounds))
    return tuple(results[criterion.id] for criterion in assignment.criteria)


def collect_within_limits(
    trials: Sequence[TrialResult],
    find: Callable[[], tuple[str, ...]],
    heartbeat: Callable[[], None] = lambda: None,
) -> tuple[str, ...]:
    """Return the results of ``find``, which don't affect marks. Empty if it exceeds its limits.

    Raises:
        HostError: No process can be started.
        Exception: Whatever ``heartbeat`` raises.
    """
    if _is_small(trials):
        with suppress(Exception, _TimeLimitExpired), _guarded():
            return find()

    def frames() -> Iterator[bytes]:
        _confine_process(_SMALL_LIMITS)
        _set_timers(_SMALL_LIMITS.cpu_seconds, _SMALL_LIMITS.seconds)
        with suppress(Exception):
            yield pickle.dumps(find())

    output_frames, _ = _run_in_process(frames, heartbeat)
    return pickle.loads(output_frames[0]) if output_frames else ()


def _is_small(trials: Sequence[TrialResult]) -> bool:
    """Return whether to judge directly, which can be interrupted only in the main thread."""
    return _count_written_characters(trials) <= _SMALL_INPUT and threading.current_thread() is threading.main_thread()


class _TimeLimitExpired(BaseException):
    """A time limit expired during direct judging. A BaseException, so that judges don't catch it."""


@contextmanager
def _guarded() -> Iterator[None]:
    """Apply small time and memory limits. Raises _Late or MemoryError in code that exceeds them."""

    def raise_timeout(*_: object) -> NoReturn:
        raise _TimeLimitExpired

    previous_handlers = {number: signal.signal(number, raise_timeout) or signal.SIG_DFL for number in _LIMIT_SIGNALS}
    memory_limits = _limit_memory(_SMALL_LIMITS.memory_bytes)
    # A collection looks at all objects of the process, whose time is not that of the judges.
    is_collecting = gc.isenabled()
    gc.disable()
    _set_timers(_SMALL_LIMITS.cpu_seconds, _SMALL_LIMITS.seconds)
    try:
        try:
            yield
        finally:
            _set_timers(0, 0)
    finally:
        # Stop the timers again, in case one expired on the way here.
        _set_timers(0, 0)
        if is_collecting:
            gc.enable()
        resource.setrlimit(resource.RLIMIT_AS, memory_limits)
        for number, handler in previous_handlers.items():
            signal.signal(number, handler)


def _count_written_characters(trials: Sequence[TrialResult]) -> int:
    """Return the amount of student-written text. Image data does not count."""
    recordings = [trial.recording for trial in trials]
    lines = (line.text for recording in recordings for line in (*recording.printed, *recording.spoken))
    messages = (message.text for recording in recordings for message in recording.messages)
    agent_texts = (message.text for recording in recordings for message in recording.agent_messages)
    texts = (*lines, *agent_texts, *(text for text in messages if not text.startswith(_IMAGE)))
    return sum(map(len, texts)) + _CHARACTERS_PER_TEXT * len(texts)


@dataclass(frozen=True, slots=True)
class _JudgingProcess:
    """The state of the judging process, from before the fork."""

    bounds: JudgingLimits
    case: Case
    results: dict[str, CriterionResult]  # also in the case; extended while judging

    def judge_criteria(self, criteria: Sequence[Criterion]) -> Iterator[bytes]:
        """Yield the result of each criterion, pickled."""
        _confine_process(self.bounds)
        for criterion in criteria:
            _set_timers(self.bounds.cpu_seconds, self.bounds.seconds)
            result = self.results[criterion.id] = self._judge_criterion(criterion)
            yield _pickle_result(result, self.case.trials)

    def _judge_criterion(self, criterion: Criterion) -> CriterionResult:
        needed_result = self.results.get(criterion.result_needed or "")
        if needed_result is not None and needed_result.unjudged:
            cause = Sentence("%(criterion)s, which it needs, could not be judged", criterion=needed_result.id)
            return _build_unjudged_result(criterion, cause)
        try:
            return judge_one(criterion, self.case)
        except MemoryError:
            megabytes = self.bounds.memory_bytes >> 20
            cause = Sentence("it used more than %(megabytes)s MB of memory", megabytes=megabytes)
            return _build_unjudged_result(criterion, cause)
        except RobomarkError as error:
            return _build_unjudged_result(criterion, str(error).rstrip(".")[:_MAX_CAUSE_LENGTH])
        except Exception as error:
            return _build_unjudged_result(criterion, f"{type(error).__name__}: {error}"[:_MAX_CAUSE_LENGTH])


def _confine_process(bounds: JudgingLimits) -> None:
    # Objects of the parent must not be finalised here: that would close its database connections.
    gc.disable()
    for number in _IGNORED_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    for number in _LIMIT_SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _LIMIT_SIGNALS)
    _limit_memory(bounds.memory_bytes)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _set_timers(cpu_seconds: float, seconds: float) -> None:
    signal.setitimer(signal.ITIMER_PROF, cpu_seconds)
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _limit_memory(extra_bytes: int) -> tuple[int, int]:
    """Limit this process to ``extra_bytes`` bytes beyond its mapped memory, and return the previous limits."""
    mapped_bytes = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    previous_limits = resource.getrlimit(resource.RLIMIT_AS)
    hard_limit = previous_limits[1]
    memory_limit = (
        mapped_bytes + extra_bytes
        if hard_limit == resource.RLIM_INFINITY
        else min(mapped_bytes + extra_bytes, hard_limit)
    )
    resource.setrlimit(resource.RLIMIT_AS, (memory_limit, hard_limit))
    return previous_limits


def _run_in_process(work: Callable[[], Iterator[bytes]], heartbeat: Callable[[], None]) -> tuple[list[bytes], int]:
    """Run ``work`` in a forked process. Return what it yielded and its wait status."""
    reader, writer = os.pipe()
    try:
        pid = os.fork()
    except OSError as error:
        os.close(reader)
        os.close(writer)
        raise HostError(f"This machine cannot start a process to judge in: {error.strerror}.") from None
    if pid == 0:
        _run_and_exit(work, writer)
    os.close(writer)
    status = None
    try:
        output = b"".join(_read_pipe(reader, heartbeat))
        _, status = os.waitpid(pid, 0)
    finally:
        os.close(reader)
        if status is None:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
    return list(_split_frames(output)), status


def _run_and_exit(work: Callable[[], Iterator[bytes]], writer: int) -> NoReturn:
    try:
        with os.fdopen(writer, "wb") as pipe, suppress(BrokenPipeError):
            for frame in work():
                pipe.write(_FRAME.pack(len(frame)))
                pipe.write(frame)
                pipe.flush()
    finally:
        # Skip the parent's exit handlers.
        os._exit(0)


def _read_pipe(reader: int, heartbeat: Callable[[], None]) -> Iterator[bytes]:
    poll = select.poll()
    poll.register(reader, select.POLLIN)
    while True:
        if poll.poll(_HEARTBEAT_MILLISECONDS):
            data = os.read(reader, 1 << 20)
            if not data:
                return
            yield data
        heartbeat()


def _split_frames(data: bytes) -> Iterator[bytes]:
    """Yield the complete frames. A frame cut off at the end is ignored."""
    offset = 0
    while offset + _FRAME.size <= len(data):
        start = offset + _FRAME.size
        offset = start + _FRAME.unpack_from(data, offset)[0]
        if offset <= len(data):
            yield data[start:offset]


class _Pickler(pickle.Pickler):
    """Refers to images of the recordings by position, because they are large and both sides have them."""

    def __init__(self, file: io.BytesIO, places: Mapping[int, tuple[int, int]]) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._places = places

    def persistent_id(self, value: Any) -> tuple[int, int] | None:
        return self._places.get(id(value)) if isinstance(value, Image) else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, trials: Sequence[TrialResult]) -> None:
        super().__init__(file)
        self._trials = trials

    def persistent_load(self, position: tuple[int, int]) -> Image:
        trial, number = position
        return self._trials[trial].recording.images[number]


def _pickle_result(result: CriterionResult, trials: Sequence[TrialResult]) -> bytes:
    places = {
        id(image): (trial, number)
        for trial, run in enumerate(trials)
        for number, image in enumerate(run.recording.images)
    }
    file = io.BytesIO()
    _Pickler(file, places).dump(result)
    return file.getvalue()


def _build_unjudged_result(criterion: Criterion, cause: str) -> CriterionResult:
    return CriterionResult(
        id=criterion.id,
        title=criterion.title,
        marks=Decimal(0),
        max_marks=criterion.marks,
        message=Sentence("This criterion could not be judged. Staff will review it."),
        visibility=criterion.visibility,
        unjudged=cause,
        for_staff=Sentence("Could not be judged: %(cause)s.", cause=cause),
    )


def _find_ending_signal(status: int) -> int:
    """Return the number of the signal that ended the process; 0 if none did."""
    return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def _describe_cause(status: int, bounds: JudgingLimits) -> str:
    signal_number = _find_ending_signal(status)
    if signal_number == signal.SIGPROF:
        return Sentence("it took more than %(seconds).0f s of computing", seconds=bounds.cpu_seconds)
    if signal_number == signal.SIGALRM:
        return Sentence("it took more than %(seconds).0f s", seconds=bounds.seconds)
    if signal_number:
        return Sentence("its process was ended by signal %(number)s", number=signal_number)
    return Sentence("its process ended before it was judged")
