"""A course with one object of every kind, made once for the tests that visit all routes."""

from __future__ import annotations

import io
import re
import zlib
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import report_builders
from builders import echo, grading_request
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.versions import freeze
from service.store.grades import appeals, results
from service.store.people import credentials, webhooks
from service.store.people.membership import Member
from service.store.queue import jobs, tryouts
from service.store.states import CredentialKind
from service.web.kept_uploads import KeptUploads
from service.web.rendering import statics
from submissions.packed import pack_submission
from submissions.raw_files import SentFile
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
    batch = intake.accept_batch(web.store, "week one", [grading_request("ada")], (), course=COURSE, max_attempts=3)
    _grade_all(web)
    given = replace(echo(), given={"notes.txt": b"counts from 0"})
    with web.store.transaction() as session:
        open_assignments.prepare(session, 1, freeze(given))
        open_assignments.open_for_students(session, 1, given.id)
    web.token(ada, "read")
    with web.store.transaction() as session:
        (token,) = credentials.of_person(session, ada.person_id)
        for kind in (CredentialKind.SESSION, CredentialKind.TOKEN):
            credentials.issue(session, ada.person_id, kind, timedelta(hours=1))
        other, session_ = (each.id for each in credentials.of_person(session, ada.person_id) if each.id != token.id)
        appeal = appeals.ask(session, 1, "Please look again.")
        hook, _ = webhooks.create(session, 1, "https://hooks.example.org/", ["grade.finished"])
    values = {
        "course_id": "1",
        "batch_id": batch.id,
        "job_id": batch.jobs[0].job_id,
        "submission_id": "1",
        "assignment": "echo-responder",
        "file": "notes.txt",
        "enrolment_id": str(ada.enrolment_id),
        "student_id": str(web.student("leaver").enrolment_id),
        "name": statics()["robomark.css"].rpartition("/")[2],
        "link": web.link(ada),
        "token_id": token.id,
        "session_id": session_,
        "credential_id": other,
        "member_id": str(web.student("guest").enrolment_id),
        "upload_id": _upload(web, grace),
        "webhook_id": hook.id,
        "criterion": report_builders.faulty_grade().criteria[0].id,
        "comment_id": "1",
        "appeal_id": str(appeal),
        "tryout_id": _tryout(web, ada),
    }
    return World(ada, grace, values)


def _tryout(web: Web, member: Member) -> str:
    """Create a test run that has a replay."""
    packed = pack_submission(grading_request("ada").submission)
    with web.store.transaction() as session:
        version_id = open_assignments.find(session, 1, "echo-responder").version_id
        asked = tryouts.ask(session, member.enrolment_id, version_id, packed)
    claimed = tryouts.claim(web.store, 60)
    assert claimed is not None
    said = {"tone": "good", "happened": "The program ended by itself.", "whose": "", "seconds": 2.0}
    more = {"lines": [], "more_lines": 0, "faults": [], "failed": "", "notes": []}
    tryouts.finish(web.store, claimed, said | more, zlib.compress(b"{}"))
    return asked


def _upload(web: Web, member: Member) -> str:
    """Create an upload in which every submission is rejected."""
    kept_uploads = KeptUploads(web.settings.home)
    begun = kept_uploads.begin(member.person_id, 1, "echo-responder")
    kept_uploads.lay(begun, [SentFile("ada.zip", io.BytesIO(b""))], "batch")
    return begun.id


def filled(path: str, values: dict[str, str]) -> str:
    """Return a route's path with its parameters filled in."""
    return re.sub(r"\{(\w+)(:\w+)?\}", lambda found: values[found[1]], path)


def _grade_all(web: Web) -> None:
    """Grade all waiting jobs at once, without a worker."""
    while claim := jobs.claim(web.store, "worker", 60):
        jobs.finish(web.store, claim, results.prepare(report_builders.faulty_grade()), datetime.now(UTC))
