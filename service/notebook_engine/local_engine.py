"""The local engine: performs the requests of one notebook, one after the other, until the notebook ends.

``lines.py`` is its protocol. The command ``robomark notebook-engine`` runs it.
"""

from __future__ import annotations

import base64
import binascii
from pathlib import Path

from responders.outside_responder import OutsideQuestion
from responders.sandbox.meter import JobLimits, JobMeter
from service.grading.grader import GradingProgress
from service.grading.standalone_runs import RunLimits
from service.grading.trial_runner import TrialRunner
from service.notebook_engine.checks import check_submission, read_checked_notebook
from service.notebook_engine.lines import (
    PROTOCOL,
    AnswerLine,
    CheckLine,
    EventLines,
    MagicLine,
    RequestLines,
    parse_line,
)
from service.notebook_engine.magic_calls import perform_magic, question_to_json
from service.notebook_engine.requests import MagicRequest
from service.version import GRADER_VERSION
from sim.errors import Cancelled, RobomarkError, UsageError
from submissions.assignment.reader import find_assignment, find_in_catalogue

#: Longest wait for an answer. The responder of a notebook may train a network first.
_ANSWER_SECONDS = 3600.0


def serve_notebook(requests: RequestLines, events: EventLines, runner: TrialRunner) -> None:
    """Serve a notebook until its requests end. Mistakes and failures are events, and never end the engine.

    Raises:
        HostError: The sandbox does not work here.
    """
    sandbox = runner.check_sandbox()
    events.send(None, "ready", protocol=PROTOCOL, version=GRADER_VERSION, sandbox=sandbox)
    _warm_up(runner)
    while (line := requests.take()) is not None:
        _serve_line(line, requests, events, runner)


def _warm_up(runner: TrialRunner) -> None:
    """Run a program once, so that the first cell waits neither for imports nor for the physics engine."""
    request = MagicRequest(cell=1, name="sim_magic", arguments="-R", body="", page=None, seed=0)
    limits = RunLimits()
    perform_magic(request, runner, lambda _: None, limits, limits.create_meter())


def _serve_line(line: bytes, requests: RequestLines, events: EventLines, runner: TrialRunner) -> None:
    request_id = None
    try:
        request = parse_line(line)
        request_id = request.id
        match request:
            case MagicLine():
                result = _perform_magic(request, requests, events, runner)
            case CheckLine():
                result = _check(request, requests, runner)
            case AnswerLine():
                raise UsageError("the notebook sent an answer, but the robot has not asked anything")
        events.send(request_id, "result", result=result)
    except Cancelled:
        raise
    except RobomarkError as error:
        events.send(request_id, "error", message=str(error))


def _perform_magic(
    request: MagicLine, requests: RequestLines, events: EventLines, runner: TrialRunner
) -> dict[str, object]:
    def ask(question: OutsideQuestion) -> str | None:
        events.send(request.id, "question", question=question_to_json(question))
        line = requests.take(_ANSWER_SECONDS)
        if line is None:
            raise Cancelled("the notebook has ended")
        answer = parse_line(line)
        if not isinstance(answer, AnswerLine) or answer.id != request.id:
            raise UsageError("the notebook sent another request before it answered the robot")
        return answer.text

    limits = RunLimits()
    meter = JobMeter(JobLimits(cpu_seconds=limits.programs_cpu_seconds), requests.check)
    return perform_magic(request.magic, runner, ask, limits, meter).to_json()


def _check(request: CheckLine, requests: RequestLines, runner: TrialRunner) -> dict[str, object]:
    def observe(_progress: GradingProgress) -> None:
        requests.check()

    folder = Path(request.assignment)
    assignment = find_assignment(folder) if folder.is_absolute() else find_in_catalogue(request.assignment)
    submission = read_checked_notebook(
        assignment,
        request.name,
        _decode_file(request.notebook),
        {name: _decode_file(data) for name, data in request.files.items()},
        Path(request.name).stem,
    )
    return check_submission(submission, assignment, runner, observe)


def _decode_file(data: str) -> bytes:
    try:
        return base64.b64decode(data, validate=True)
    except (binascii.Error, ValueError):
        raise UsageError("the notebook sent a file that is not base64") from None
