"""Statements on published grades, receipts of submissions, and the keys that sign both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Conflict, NotFound
from service.operations.lookup import (
    check_operator,
    load_names_for_actor,
    require_course,
    require_job,
    require_own_submission,
)
from service.statements.envelopes import Envelope
from service.statements.facts import FactKind
from service.statements.keys import KeyLine, PublicKey
from service.statements.merkle_tree import build_inclusion_proof, compute_root
from service.statements.statement import PredicateType, format_moment, sign_statement
from service.statements.statement_file import LogPlace, StatementFile
from service.statements.tick_columns import encode_columns
from service.store import audit, statement_log
from service.store.batches import stored_requests
from service.store.engine import now, retry_conflicts
from service.store.grades import results
from service.store.grades.statements import GradeFacts, load_facts, load_marks_facts
from service.store.installation import load_secret
from service.store.states import Role
from service.store.tables.courses import AssignmentVersion, Course
from service.store.tables.people import Enrolment
from service.store.tables.statements import StatementEntry
from service.store.tables.submissions import Job, SubmissionRow
from submissions.seeds import choose_secret


@dataclass(frozen=True, slots=True)
class StatementDownload:
    """A file to download."""

    data: bytes
    name: str


def show_own_receipt(service: Service, actor: Actor, course_id: int, submission_id: int) -> StatementDownload:
    """Return a signed receipt of a submission of the actor. Raises NotFound."""
    with service.store.reading() as session:
        row = require_own_submission(session, actor, course_id, submission_id)
        parts = _describe_submission(session, row)
        name = f"receipt-{row.assignment}-{row.attempt}.json"
    envelope = _sign(service, PredicateType.RECEIPT, **parts)
    return StatementDownload(StatementFile(envelope, _load_public_keys(service)).to_bytes(), name)


def show_own_statement(service: Service, actor: Actor, course_id: int, submission_id: int) -> StatementDownload:
    """Return the statement on the published grade of a submission of the actor, with the facts that students see.

    Raises NotFound, Conflict before the grade is published.
    """
    with service.store.reading() as session:
        row = require_own_submission(session, actor, course_id, submission_id)
        entry, envelope = _require_entry(session, row.id)
        grade_facts = load_marks_facts(session, [str(entry.job_id)])[str(entry.job_id)]
        leaves = statement_log.load_leaves(session)
        facts = grade_facts.open_facts(bytes.fromhex(entry.opening_key or ""), *_list_student_kinds(grade_facts))
        name = f"statement-{row.assignment}-{row.attempt}.json"
    place = _build_place(service, entry, leaves)
    return StatementDownload(StatementFile(envelope, _load_public_keys(service), place, facts).to_bytes(), name)


def show_statement(service: Service, actor: Actor, course_id: int, job_id: str) -> StatementDownload:
    """Return the statement on a published grade for staff, with all facts, seeds and ticks.

    Raises NotFound, also if names are hidden because the statement names the student. Raises Conflict before the grade
    is published.
    """
    hidden_names = load_names_for_actor(service, actor, course_id)
    own_secret = load_secret(service.store)
    with service.store.reading() as session:
        require_course(session, actor, course_id, Role.INSTRUCTOR)
        job = require_job(session, course_id, job_id)
        submission = session.get_one(SubmissionRow, job.submission_id)
        if submission.assignment in hidden_names.assignments:
            raise NotFound("There is no such page or item, or you have no access to it.")
        entry, envelope = _require_entry(session, submission.id)
        stated_job = session.get_one(Job, entry.job_id)
        grade_facts = load_facts(session, [stated_job.id])[stated_job.id]
        facts = grade_facts.open_facts(bytes.fromhex(entry.opening_key or ""), *FactKind)
        leaves = statement_log.load_leaves(session)
        assignment = stored_requests.load_assignment(session, stated_job.id)
        grade = results.load_original_grade(session, stated_job.id)
    secret = choose_secret(grade.secret_sha256, own_secret)
    place = _build_place(service, entry, leaves)
    columns = {number: encode_columns(trial.recording.ticks) for number, trial in enumerate(grade.trials, 1)}
    file = StatementFile(
        envelope,
        _load_public_keys(service),
        place,
        facts,
        None if secret is None else assignment.build_seed_table(secret),
        columns,
    )
    return StatementDownload(file.to_bytes(), f"statement-{submission.assignment}-{job_id}-staff.json")


def list_keys(service: Service) -> list[KeyLine]:
    """Return the public keys, oldest first. Everybody may read them."""
    with service.store.reading() as session:
        return statement_log.list_keys(session)


def rotate_key(service: Service, actor: Actor) -> KeyLine:
    """Create a key that signs from now on, and retire the current one. Raises NotFound for non-operators."""
    check_operator(actor)
    return _rotate_key(service, actor)


def revoke_key(service: Service, actor: Actor, key_id: str) -> KeyLine:
    """Revoke a key that others may know.

    Raises NotFound for non-operators, UsageError for an unknown or revoked key.
    """
    check_operator(actor)
    return _revoke_key(service, actor, key_id)


@retry_conflicts
def _rotate_key(service: Service, actor: Actor) -> KeyLine:
    with service.store.transaction() as session:
        line = statement_log.rotate_key(session)
        audit.record_action(session, actor.name, "rotate", "statement_key", line.key.id)
        return line


@retry_conflicts
def _revoke_key(service: Service, actor: Actor, key_id: str) -> KeyLine:
    with service.store.transaction() as session:
        line = statement_log.revoke_key(session, key_id)
        audit.record_action(session, actor.name, "revoke", "statement_key", line.key.id)
        return line


def _sign(service: Service, predicate_type: PredicateType, **parts: Any) -> Envelope:
    """Return a signed statement that is not in the log. Locks the log only to create the first key."""
    with service.store.reading() as session:
        moment = format_moment(now(session))
        key = statement_log.find_signing_key(session)
    if key is None:
        key = _create_key(service)
    predicate = {**parts["predicate"], "issued_at": moment}
    return sign_statement(key, predicate_type, parts["subjects"], predicate)


@retry_conflicts
def _create_key(service: Service) -> Any:
    with service.store.transaction() as session:
        return statement_log.ensure_signing_key(session)


def _load_public_keys(service: Service) -> tuple[PublicKey, ...]:
    return tuple(line.key for line in list_keys(service))


def _describe_submission(session: Session, row: SubmissionRow) -> dict[str, Any]:
    """Return the subjects and the predicate of a receipt."""
    query = (
        select(Course.name, Enrolment.student, AssignmentVersion)
        .join(Enrolment, Enrolment.course_id == Course.id)
        .join(Job, Job.enrolment_id == Enrolment.id)
        .join(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
        .where(Job.submission_id == row.id)
        .order_by(Job.queued_at, Job.id)
        .limit(1)
    )
    course, student, version = session.execute(query).one()
    predicate = {
        "course": course,
        "student": student,
        "assignment": {"id": version.assignment, "version": version.version},
        "attempt": row.attempt,
        "submitted_at": format_moment(row.submitted_at or row.created_at),
        "received_at": format_moment(row.created_at),
    }
    return {"subjects": {"submission": row.sha256}, "predicate": predicate}


def _require_entry(session: Session, submission_id: int) -> tuple[StatementEntry, Envelope]:
    """Return the newest entry of a submission, with its statement. Raises Conflict without a valid one."""
    entry = statement_log.load_newest_entry(session, submission_id)
    envelope = None if entry is None else statement_log.read_envelope(entry)
    if entry is None or envelope is None or entry.opening_key is None:
        raise Conflict("there is no statement: statements are made when a grade is published")
    return entry, envelope


def _build_place(service: Service, entry: StatementEntry, leaves: Sequence[bytes]) -> LogPlace:
    """Return the place of an entry in the log, with a head that is signed now."""
    head = sign_head(service, leaves)
    proof = tuple(each.hex() for each in build_inclusion_proof(leaves, entry.number))
    return LogPlace(entry.salt or "", proof, head)


def sign_head(service: Service, leaves: Sequence[bytes]) -> Envelope:
    """Return a signed head of the log with these leaf hashes."""
    root = compute_root(leaves).hex()
    return _sign(service, PredicateType.LOG_HEAD, subjects={"log": root}, predicate={"size": len(leaves)})


def _list_student_kinds(grade_facts: GradeFacts) -> tuple[FactKind, ...]:
    """Return the kinds of facts that students see. The total would tell the marks of hidden criteria."""
    has_hidden_criteria = bool(grade_facts.values[FactKind.HIDDEN_CRITERION])
    return (FactKind.CRITERION,) if has_hidden_criteria else (FactKind.TOTAL, FactKind.CRITERION)
