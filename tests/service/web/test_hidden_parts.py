"""Students get the same answers however many scenarios and criteria are hidden from them.

Each example is graded against two versions of an assignment that differ only in their hidden parts. The routes are
taken from the application, so that new routes are included.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

import pytest

import acting
import builders
from builders import echo
from responders.source_file import SourceFile
from service.grading.grade import Grade, build_unjudged_notes
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.grades import results
from service.store.installation import load_secret
from service.store.queue import jobs
from service.test_runs import build_single_trial_assignment
from sim.recording import Pose
from student_reader import StudentReader
from submissions.assignment.definition import Assignment
from submissions.assignment.folder import locate_assignment_folder
from submissions.bundle import read_submission
from submissions.grading_request import GradingRequest
from submissions.submission import Submission
from web import web_in

_WAITING = "waiting"
#: Correct, wrong, ended by an exception, by the CPU limit (where trials are spared) and by the time limit.
_EXAMPLES = (
    *(pytest.param(name, marks=pytest.mark.long) for name in ("reference", "responder-raises", "endless", _WAITING)),
    "flawed",
)
_MOMENT = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?")
#: Hashes, salts, keys and ids of keys.
_RANDOM = re.compile(r"\b[0-9a-f]{16,}\b")


def _assignment(hidden: int, *, first: bool, seconds: float) -> Assignment:
    """Return the echo assignment with a number of hidden scenarios and criteria. The total marks never change."""
    whole = echo()
    (own,) = whole.scenarios
    visible_scenario = replace(own, poses=tuple(Pose(x, 800, 0) for x in (100, 150, 200, 250)), seconds=90)
    others = tuple(replace(own, id=f"secret-{n}", visibility="hidden", seconds=seconds) for n in range(hidden))
    criteria = tuple(
        whole.criteria[0].model_copy(
            update={"id": f"secret-{n}", "visibility": "hidden", "marks": Decimal(12) / hidden, "scenarios": ()}
        )
        for n in range(hidden)
    )
    limits = replace(whole.limits, program_cpu=0.5, responder_cpu=0.5)
    scenarios = (*others, visible_scenario) if first else (visible_scenario, *others)
    return replace(whole, scenarios=scenarios, criteria=(*whole.criteria, *criteria), limits=limits)


_FEW = _assignment(1, first=False, seconds=90)
_MANY = _assignment(3, first=True, seconds=60)


@pytest.mark.long
@pytest.mark.parametrize("example", _EXAMPLES)
def test_answers_do_not_depend_on_what_is_hidden(
    tmp_path: Path, runner: TrialRunner, monkeypatch: pytest.MonkeyPatch, example: str
) -> None:
    monkeypatch.setattr(builders, "token_hex", lambda size: "5e" * size)
    few, many = (
        _answers(tmp_path / name, assignment, example, runner, progress)
        for name, assignment, progress in (("few", _FEW, 0.5), ("many", _MANY, 0.2))
    )
    assert len(few) > 20
    assert {path for path in few if few[path] != many[path]} == set()


def test_programs_are_tried_the_same_whatever_is_hidden() -> None:
    assert build_single_trial_assignment(_FEW) == build_single_trial_assignment(_MANY)


def _answers(
    home: Path, assignment: Assignment, example: str, runner: TrialRunner, progress: float
) -> dict[str, object]:
    """Return Ada's answers while her submission is graded, after grading, and after publication."""
    submission = _submission(example)
    with web_in(home) as web:
        ada = web.student("ada")
        with web.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(assignment))
            open_assignments.open_for_students(session, 1, assignment.id)
            batch_id = open_assignments.load_course_assignment(session, 1, assignment.id).batch_id or ""
        request = GradingRequest(submission, assignment, example)
        accepted = intake.accept_submission(web.store, request, max_attempts=3, batch_id=batch_id)
        student_reader = StudentReader(
            web, ada, {"submission_id": str(accepted.submission_id), "assignment": assignment.id}
        )
        claim = jobs.claim_job(web.store, "worker", 60)
        assert claim is not None
        jobs.renew_lease(web.store, claim, 60, progress)
        responses = student_reader.everything("while it is graded")
        graded = _unjudged(grade(submission, assignment, secret=load_secret(web.store), runner=runner))
        jobs.finish_job(web.store, claim, results.prepare_grade(graded), datetime.now(UTC))
        responses |= student_reader.everything("graded")
        acting.publish(web.store, batch_id, actor="grace", includes_held_back=True)
        responses |= student_reader.everything("published")
        for form in ("moodle", "gradescope"):
            responses[form] = acting.export_file(web.store, batch_id, form, published=False).data.decode()
        responses["gradescope"] = _shown_by_gradescope(str(responses["gradescope"]))
        changing = {accepted.job_id: "JOB", batch_id: "BATCH", student_reader.word: "WORD"}
        return {path: _without(changing, content) for path, content in responses.items()}


def _submission(example: str) -> Submission:
    if example != _WAITING:
        return read_submission(locate_assignment_folder("echo-responder") / "examples" / example, student="ada")
    program = SourceFile("robot.py", "import time\ntime.sleep(70)\ntime.sleep(70)\n")
    return replace(_submission("reference"), program=program)


def _unjudged(graded: Grade) -> Grade:
    """Return the grade as if the hidden criteria and the first visible one had failed to be judged."""
    broken = {graded.criteria[0].id, *(each.id for each in graded.criteria if each.visibility == "hidden")}
    criteria = tuple(
        replace(each, unjudged="The check failed." if each.id in broken else "") for each in graded.criteria
    )
    return replace(graded, criteria=criteria, notes=(*graded.notes, *build_unjudged_notes(criteria)))


def _shown_by_gradescope(text: str) -> str:
    """Return the part that students see there. The visibility sent with each test hides it."""
    (document,) = json.loads(text)
    return json.dumps(document | {"tests": [each for each in document["tests"] if each["visibility"] == "visible"]})


def _read_signed(text: str) -> str:
    """Return a receipt or statement with its payloads as text, and random numbers and signatures replaced."""
    if '"robomark_statement"' not in text:
        return text
    payloads = re.sub(r'"payload": "([^"]*)"', lambda match: base64.b64decode(match[1]).decode(), text)
    return re.sub(r'"sig": "[^"]*"', "SIGNATURE", _RANDOM.sub("RANDOM", payloads))


def _without(changing: Mapping[str, str], content: object) -> object:
    """Return the value without parts that change each time: ids, times, CSRF tokens."""
    if isinstance(content, dict):
        return {name: _without(changing, text) for name, text in content.items()}
    text = _MOMENT.sub("MOMENT", _read_signed(str(content)))
    for value, name in changing.items():
        text = text.replace(value, name)
    return text
