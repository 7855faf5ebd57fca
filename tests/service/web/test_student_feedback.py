"""No student sees texts for staff or faults of the host: on pages, in API answers, in gradebooks."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from sqlalchemy import select

import acting
import report_builders
from builders import PROGRAM, echo, grading_request
from rows import quick_first
from service.reports.formats import FORMATS
from service.store.batches import intake
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.grades import results
from service.store.people.membership import Member
from service.store.queue import jobs, self_tests
from service.store.queue.jobs import Claim, RetryPolicy
from service.store.tables.submissions import Job
from sim.errors import UsageError
from student_reader import StudentReader
from web import COURSE, Web

#: The output of these formats is for staff only.
_STAFF_FORMATS = {"csv", "csv-long", "json", "junit", "text", "rich"}
_SECRET = "/srv/secret-disk"
_WORKSHEET = "Identifier,ID number,Grade,Feedback comments\nParticipant 1234567,ada,,\n"
_SOURCE = "Ada Lovelace_1234567_assignsubmission_file"


def _fail(web: Web, claim: Claim) -> None:
    jobs.fail_job(web.store, claim, f"HostError: {_SECRET} is full", RetryPolicy(0.0))


def _give_up(web: Web, claim: Claim) -> None:
    jobs.give_up_job(web.store, claim, f"the assignment's check.py raised KeyError: {_SECRET}")


def _cancel(web: Web, claim: Claim) -> None:
    with web.store.reading() as session:
        batch_id = session.scalars(select(Job.batch_id).where(Job.id == claim.job_id)).one()
    acting.cancel(web.store, str(batch_id), actor=_SECRET)


def _finish(web: Web, claim: Claim) -> None:
    grade = report_builders.faulty_grade()
    broken = {"unjudged": f"KeyError: {_SECRET}", "for_staff": f"Could not be judged: {_SECRET}."}
    criteria = tuple(replace(each, **broken) for each in grade.criteria)  # type: ignore[arg-type]
    jobs.finish_job(web.store, claim, results.prepare_grade(replace(grade, criteria=criteria)), datetime.now(UTC))


def _quarantine(web: Web, claim: Claim) -> None:
    _finish(web, claim)
    self_tests.quarantine_worker(web.store, _SECRET, f"{_SECRET} adds wrongly")


_ENDINGS: dict[str, Callable[[Web, Claim], None]] = {
    "host fault": _fail,
    "assignment fault": _give_up,
    "cancelled": _cancel,
    "criterion that could not be judged": _finish,
    "quarantine": _quarantine,
}


@pytest.mark.long
@pytest.mark.parametrize("ending", quick_first(_ENDINGS, quick=2))
def test_students_read_no_fault_of_ours(web: Web, ending: str) -> None:
    ada, batch_id = _submit(web)
    claim = jobs.claim_job(web.store, _SECRET, 60)
    assert claim is not None
    _ENDINGS[ending](web, claim)
    acting.publish(web.store, batch_id, actor="grace", includes_held_back=True)
    assert _read_by_students(web, ada, batch_id, claim.job_id, _SECRET) == []


def test_no_gradebook_has_an_attempt_over_a_limit(web: Web) -> None:
    web.student("ada")
    with web.store.transaction() as session:
        policies.set_policy(session, 1, "", PolicyLimits(attempts=1))
    _submit(web)
    claim = jobs.claim_job(web.store, "worker", 60)
    assert claim is not None
    _finish(web, claim)
    _, batch_id = _submit(web, "print('again')\n")
    with web.store.reading() as session:
        over = session.scalars(select(Job.id).where(Job.batch_id == batch_id)).one()
    gradebooks = _gradebooks(web, batch_id)
    assert gradebooks
    assert [name for name, text in gradebooks.items() if over in text or "attempt 2" in text] == []


def _submit(web: Web, program: str = PROGRAM) -> tuple[Member, str]:
    """Submit for Ada in a separate batch from Moodle."""
    ada = web.student("ada")
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.open_for_students(session, 1, "echo-responder")
    request = replace(grading_request("ada", program), source=_SOURCE)
    accepted = intake.accept_new_submissions(web.store, "week one", [request], (), course=COURSE, max_attempts=1)
    assert accepted.batch is not None
    return ada, accepted.batch.id


def _read_by_students(web: Web, ada: Member, batch_id: str, job_id: str, secret: str) -> list[str]:
    """Return the places where students can read the secret."""
    with web.store.reading() as session:
        submission_id = session.get_one(Job, job_id).submission_id
    values = {"submission_id": str(submission_id), "assignment": "echo-responder"}
    answers = StudentReader(web, ada, values).everything()
    assert any("200" in str(answer)[:4] for answer in answers.values())
    texts = {path: str(answer) for path, answer in answers.items()} | _gradebooks(web, batch_id)
    return [path for path, text in texts.items() if secret in text]


def _gradebooks(web: Web, batch_id: str) -> dict[str, str]:
    """Return the output of each format that students see, where it has any for the batch."""
    gradebooks = {}
    for name in FORMATS.keys() - _STAFF_FORMATS:
        given = _WORKSHEET if FORMATS[name].worksheet is not None else ""
        try:
            data = acting.export_file(web.store, batch_id, name, published=False, given=given).data
        except UsageError as error:
            gradebooks[name] = str(error)
            continue
        gradebooks[name] = _unzipped(data) if data.startswith(b"PK") else data.decode()
    return gradebooks


def _unzipped(data: bytes) -> str:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return "\n".join(archive.read(name).decode() for name in archive.namelist())
