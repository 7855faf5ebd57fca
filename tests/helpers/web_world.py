"""A course with one object of every kind, made once for the tests that visit all routes."""

from __future__ import annotations

import io
import re
import zlib
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import report_builders
from builders import echo, grading_request, prepared, release_at_once
from service.notebook_engine.stored_requests import build_owner
from service.pending_uploads import PendingUploads
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.grades import appeals
from service.store.people import credentials, webhooks
from service.store.people.membership import Member
from service.store.queue import jobs, notebook_runs, test_runs
from service.store.states import CredentialKind
from service.web.rendering import build_static_paths
from submissions.raw_files import UploadedFile
from submissions.stored_submission import pack_submission
from web import COURSE, Web


@dataclass(frozen=True, slots=True)
class World:
    """Ada's submission in Grace's course, and the path values of all objects."""

    ada: Member
    grace: Member
    values: dict[str, str]


def make_world(web: Web) -> World:
    """Create one object of every kind."""
    ada, grace = web.student("ada"), web.instructor("grace")
    release_at_once(web.store)
    batch = intake.accept_batch(web.store, "week one", [grading_request("ada")], (), course=COURSE, max_attempts=3)
    _grade_all(web)
    given = replace(echo(), given={"notes.txt": b"counts from 0"})
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(given))
        open_assignments.open_for_students(session, 1, given.id)
    web.token(ada, "read")
    with web.store.transaction() as session:
        (token,) = credentials.list_credentials(session, ada.person_id)
        for kind in (CredentialKind.SESSION, CredentialKind.TOKEN):
            credentials.issue_credential(session, ada.person_id, kind, timedelta(hours=1))
        other, session_ = (
            each.id for each in credentials.list_credentials(session, ada.person_id) if each.id != token.id
        )
        appeal = appeals.open_appeal(session, 1, "Please look again.")
        hook, _ = webhooks.create_webhook(session, 1, "https://hooks.example.org/", ["grade.finished"])
    values = {
        "course_id": "1",
        "batch_id": batch.id,
        "job_id": batch.jobs[0].job_id,
        "submission_id": "1",
        "assignment": "echo-responder",
        "file": "notes.txt",
        "enrolment_id": str(ada.enrolment_id),
        "student_id": str(web.student("leaver").enrolment_id),
        "name": build_static_paths()["robomark.css"].rpartition("/")[2],
        "link": web.link(ada),
        "token_id": token.id,
        "session_id": session_,
        "credential_id": other,
        "member_id": str(web.student("guest").enrolment_id),
        "upload_id": create_upload(web, grace),
        "webhook_id": hook.id,
        "criterion": report_builders.faulty_grade().criteria[0].id,
        "comment_id": "1",
        "appeal_id": str(appeal),
        "tryout_id": _tryout(web, ada),
        "run_id": _notebook_run(web, ada),
    }
    return World(ada, grace, values)


def _tryout(web: Web, member: Member) -> str:
    """Create a test run that has a replay."""
    packed = pack_submission(grading_request("ada").submission)
    with web.store.transaction() as session:
        version_id = open_assignments.load_course_assignment(session, 1, "echo-responder").version_id
        test_run = test_runs.queue_test_run(session, member.enrolment_id, version_id, packed)
    claimed = test_runs.claim_test_run(web.store, 60)
    assert claimed is not None
    result = {"tone": "good", "happened": "The program ended by itself.", "whose": "", "seconds": 2.0}
    more = {"lines": [], "more_lines": 0, "faults": [], "failed": "", "notes": []}
    test_runs.finish_test_run(web.store, claimed, result | more, zlib.compress(b"{}"))
    return test_run


def _notebook_run(web: Web, member: Member) -> str:
    """Create a run of a notebook that has a result."""
    owner = freeze_assignment(build_owner(test_runs.NOTEBOOK_RUNS))
    with web.store.transaction() as session:
        run_id = notebook_runs.queue_notebook_run(session, member.enrolment_id, owner, b"")
    claimed = test_runs.claim_test_run(web.store, 60)
    assert claimed is not None
    test_runs.finish_test_run(web.store, claimed, {}, zlib.compress(b"{}"))
    return run_id


def create_upload(web: Web, member: Member) -> str:
    """Create an upload in which every submission is rejected."""
    kept_uploads = PendingUploads(web.settings.home)
    begun = kept_uploads.begin(member.person_id, 1, "echo-responder")
    kept_uploads.store_files(begun, [UploadedFile("ada.zip", io.BytesIO(b""))], "batch")
    return begun.id


def filled(path: str, values: dict[str, str]) -> str:
    """Return a route's path with its parameters filled in."""
    return re.sub(r"\{(\w+)(:\w+)?\}", lambda match: values[match[1]], path)


def _grade_all(web: Web) -> None:
    """Grade all waiting jobs at once, without a worker."""
    while claim := jobs.claim_job(web.store, "worker", 60):
        jobs.finish_job(web.store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
