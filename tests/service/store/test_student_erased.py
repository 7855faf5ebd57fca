"""One student's data: exported completely as a zip, or erased completely, with other students' data unchanged."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from pathlib import Path

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

import acting
import report_builders
from builders import grading_request, prepared, release_at_once, settings_in
from service.operations import privacy
from service.pending_uploads import PendingUploads
from service.store import audit
from service.store.batches import intake
from service.store.courses import policies
from service.store.engine import Store
from service.store.grades import marking_history, results
from service.store.people import credentials, membership
from service.store.people.reach import Reach
from service.store.people.students import ensure_course
from service.store.purge import PurgeCounts, purge_submissions
from service.store.queue import jobs
from service.store.states import CredentialKind, Role
from service.store.tables import METADATA
from service.store.tables.courses import OpenAssignment
from service.store.tables.grades import Appeal, Comment, Override
from service.store.tables.installation import IdempotentReply
from service.store.tables.people import Enrolment, LtiPerson, LtiPlatform
from service.store.tables.submissions import Job, SubmissionRow, Tryout
from service.student_export import export_student
from sim.errors import UsageError
from submissions.student_identity import RejectedSubmission, Student

NOW = datetime.now(UTC)
#: Identifying data of a student; none of it may remain.
KNOWN = ("ada-known-as", "Lovelace", "ada@example.org")


def submit(store: Store, *students: Student, refused: str = "") -> None:
    requests = [replace(grading_request(each.id), listed_student=each, source=f"{each.id}.zip") for each in students]
    refusals = (RejectedSubmission("x.zip", "is empty", Student(refused)),) if refused else ()
    intake.accept_batch(store, "batch", requests, refusals, course="default", max_attempts=3)
    while claim := jobs.claim_job(store, "worker", 60):
        jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), NOW)


def everything(store: Store) -> int:
    """Create a student with a row in every table that refers to students, and another student. Return the enrolment."""
    ada, bob = Student(KNOWN[0], KNOWN[1], KNOWN[2]), Student("bob")
    submit(store, ada, bob, refused=KNOWN[0])
    with store.transaction() as session:
        enrolment = session.scalars(select(Enrolment).where(Enrolment.student == KNOWN[0])).one()
        theirs, others = session.scalars(select(Job).order_by(Job.enrolment_id)).all()
        others.copied_from = theirs.id
        submission_id, person_id = theirs.submission_id, enrolment.person_id
        version_id = theirs.assignment_version_id
        session.add(Override(submission_id=submission_id, criterion="a", marks=Decimal(1), reason=KNOWN[1], actor="g",
                             made_at=NOW))  # fmt: skip
        session.add(Comment(submission_id=submission_id, text=KNOWN[1], actor="grace", made_at=NOW))
        session.add(Appeal(submission_id=submission_id, text=f"I am {KNOWN[1]}", asked_at=NOW))
        session.add(OpenAssignment(course_id=1, assignment="echo-responder", assignment_version_id=version_id))
        session.add(Tryout(enrolment_id=enrolment.id, assignment_version_id=version_id, packed=b"", state="done",
                           queued_at=NOW, words={"said": KNOWN[1]}, replay=zlib.compress(b"{}")))  # fmt: skip
        policies.extend_policy(session, enrolment.id, "", NOW, 1)
        credentials.issue_credential(
            session,
            person_id,
            CredentialKind.TOKEN,
            timedelta(days=1),
            name=KNOWN[1],
            reach=Reach(scopes=frozenset({"read"})),
        )
        session.flush()
        token = credentials.list_credentials(session, person_id)[0].id
        session.add(IdempotentReply(credential_id=token, key="k", request_sha256="", status=200, body=b"", made_at=NOW))
        platform = LtiPlatform(name="p", issuer="i", client_id="c", authorization_url="", token_url="", keys_url="",
                               created_at=NOW)  # fmt: skip
        session.add(platform)
        session.flush()
        session.add(LtiPerson(platform_id=platform.id, subject=KNOWN[0], person_id=person_id))
        audit.record_action(session, f"{KNOWN[1]} (person {person_id})", "submit", "submission", str(submission_id))
        audit.record_action(session, "grace", "extend", "course", "1", student=KNOWN[0])
        return enrolment.id


def test_nothing_is_left_of_who_is_erased_but_that_it_was_done(store: Store) -> None:
    enrolment_id = everything(store)
    before = _dump(store)
    assert all(word in before for word in KNOWN)
    gone = _erase(store, enrolment_id)
    assert (gone.submissions, gone.grades) == (1, 1)
    left = _dump(store)
    assert [word for word in KNOWN if word in left] == []
    with store.reading() as session:
        assert audit.load_entries(session, "enrolment", str(enrolment_id))[0].detail == {"submissions": 1, "grades": 1}
        assert session.scalars(select(Enrolment.student)).all() == ["bob"]
        (job,) = session.scalars(select(Job)).all()
        assert results.load_grade(session, job.id).marks == report_builders.faulty_grade().marks
        assert job.copied_from is None


def test_every_table_that_knows_students_is_thought_of(store: Store) -> None:
    everything(store)
    knows = {"enrolment", "person", "submission", "job", "credential"}
    pointing = {
        table for table in METADATA.sorted_tables for key in table.foreign_keys if key.column.table.name in knows
    }
    with store.reading() as session:
        empty = {table.name for table in pointing if session.execute(select(table).limit(1)).first() is None}
    assert empty == set()


def test_who_is_in_another_course_stays_there(store: Store) -> None:
    enrolment_id = everything(store)
    with store.transaction() as session:
        _in_another_course(session, session.get_one(Enrolment, enrolment_id).person_id)
    _erase(store, enrolment_id)
    with store.reading() as session:
        assert KNOWN[1] in session.scalars(select(Enrolment.name)).all()
        kept = session.scalars(
            select(Enrolment.student).join(SubmissionRow, SubmissionRow.enrolment_id == Enrolment.id)
        )
        assert kept.all() == ["bob"]


def test_stored_replies_and_waiting_uploads_of_the_course_are_erased(store: Store, tmp_path: Path) -> None:
    enrolment_id = everything(store)
    with store.transaction() as session:
        another = ensure_course(session, "another", NOW)
        for course, person in (("default", "grace"), ("another", "mallory")):
            member = membership.make_instructor(session, course, Student(person))
            credentials.issue_credential(
                session,
                member.person_id,
                CredentialKind.TOKEN,
                timedelta(days=1),
                name="t",
                reach=Reach(scopes=frozenset({"read"})),
            )
            token = credentials.list_credentials(session, member.person_id)[0].id
            for key, status in (("done", 201), ("in progress", 0)):
                row = IdempotentReply(credential_id=token, key=f"{person} {key}", request_sha256="", status=status)
                row.body, row.made_at = KNOWN[1].encode() if status else b"", NOW
                session.add(row)
    service = replace(acting.service_on(store), settings=settings_in(tmp_path))
    service.settings.home.mkdir(exist_ok=True)
    uploads = PendingUploads(service.settings.home)
    waiting = [uploads.begin(1, course_id, "echo-responder") for course_id in (1, another)]
    privacy.erase_student(service, acting.machine(), 1, enrolment_id)
    with store.reading() as session:
        keys = set(session.scalars(select(IdempotentReply.key)))
    assert keys == {"grace in progress", "mallory done", "mallory in progress"}
    assert [uploads.find(each.id, 1, each.course_id) is not None for each in waiting] == [False, True]


def test_a_new_submission_has_no_history_of_an_erased_one(store: Store) -> None:
    erased = intake.accept_submission(store, grading_request("ada"), max_attempts=1)
    with store.transaction() as session:
        audit.record_action(session, "grace", "override", "submission", str(erased.submission_id), criterion="a")
        assert len(marking_history.load_history(session, erased.submission_id)) == 1
    _erase(store, 1)
    new = intake.accept_submission(store, grading_request("bea"), max_attempts=1)
    with store.transaction() as session:
        # SQLite reuses ids; PostgreSQL does not.
        audit.record_action(session, "grace", "comment", "submission", str(new.submission_id), criterion="a")
        assert [step.action for step in marking_history.load_history(session, new.submission_id)] == ["comment"]


def test_who_is_being_graded_or_instructs_is_not_erased(store: Store) -> None:
    intake.accept_submission(store, grading_request("ada"), max_attempts=1)
    assert jobs.claim_job(store, "worker", 60)
    with pytest.raises(UsageError, match="is being graded"):
        _erase(store, 1)
    with store.transaction() as session:
        session.get_one(Enrolment, 1).role = Role.INSTRUCTOR
    with pytest.raises(UsageError, match="is not a student"):
        _erase(store, 1)


def test_an_instructor_stays_when_their_old_submissions_go(store: Store) -> None:
    submit(store, Student("ada"), Student("bob"))
    with store.transaction() as session:
        session.scalars(select(Enrolment).where(Enrolment.student == "ada")).one().role = Role.INSTRUCTOR
    gone = purge_submissions(store, datetime.now(UTC) + timedelta(days=1), "grace")
    assert (gone.submissions, gone.students) == (2, 1)
    with store.reading() as session:
        assert session.scalars(select(Enrolment.student)).all() == ["ada"]


def test_what_is_old_goes_with_all_that_was_said_of_it(store: Store) -> None:
    everything(store)
    gone = purge_submissions(store, datetime.now(UTC) + timedelta(days=1), "grace", course_id=2)
    assert gone.submissions == 0
    gone = purge_submissions(store, datetime.now(UTC) + timedelta(days=1), "grace", course_id=1)
    assert (gone.submissions, gone.students) == (2, 2)
    with store.reading() as session:
        assert session.scalars(select(Appeal.id)).all() == []
        # Open assignments stay open.
        assert session.scalars(select(OpenAssignment.assignment)).all() == ["echo-responder"]


def test_the_zip_has_what_the_student_may_see(store: Store) -> None:
    enrolment_id = everything(store)
    release_at_once(store)
    with zipfile.ZipFile(io.BytesIO(export_student(store, enrolment_id))) as archive:
        names = set(archive.namelist())
        document = json.loads(archive.read("student.json"))
        grade = json.loads(archive.read("submissions/echo-responder-1/grade.json"))
    folder = "submissions/echo-responder-1"
    files = (f"{folder}/{name}" for name in ("submission.zip", "grade.json", "report.html"))
    assert names == {"student.json", "test-runs/echo-responder-1/replay.json", *files}
    (run,) = document["test_runs"]
    assert (run["assignment"], run["words"]) == ("echo-responder", {"said": KNOWN[1]})
    assert [each["source"] for each in document["rejected_files"]] == ["x.zip"]
    with zipfile.ZipFile(io.BytesIO(export_student(store, enrolment_id, {"echo-responder"}))) as archive:
        hidden = json.loads(archive.read("student.json"))
    assert (hidden["test_runs"], hidden["rejected_files"]) == ([], [])
    assert (document["id"], document["name"], document["email"]) == KNOWN
    assert document["submissions"][0]["appeals"][0]["text"] == f"I am {KNOWN[1]}"
    assert document["extensions"][0]["more_attempts"] == 1
    assert "secret" not in json.dumps(document)
    visible_ids = {each.id for each in report_builders.faulty_grade().criteria if each.visibility == "visible"}
    assert {each["id"] for each in grade["criteria"]} == visible_ids


def _in_another_course(session: Session, person_id: int) -> None:
    course_id = ensure_course(session, "another", NOW)
    row = Enrolment(course_id=course_id, person_id=person_id, student="x", written="x", role=Role.STUDENT)
    row.name = KNOWN[1]
    session.add(row)


def _dump(store: Store) -> str:
    """Return all data in the database that is not compressed."""
    with store.reading() as session:
        return "\n".join(str(row) for table in METADATA.sorted_tables for row in session.execute(select(table)))


def _erase(store: Store, enrolment_id: int) -> PurgeCounts:
    return privacy.erase_student(acting.service_on(store), acting.machine("grace"), 1, enrolment_id)
