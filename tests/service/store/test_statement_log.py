"""The log of statements: each change of a published mark appends an entry, and the check names what was altered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any

import pytest
from sqlalchemy import delete, insert, select, update
from sqlalchemy.orm import Session

import acting
import report_builders
from builders import grading_request, prepared
from service.grading.grade import Grade
from service.operations import grades, privacy, statement_log, statements
from service.operations.errors import Conflict
from service.operations.grades import MarksRequest
from service.operations.statement_log import LogReport
from service.statements.keys import SigningKey, generate_signing_key
from service.statements.log_head import FiledHead
from service.statements.statement import parse_statement, sign_statement
from service.statements.statement_check import check_statement
from service.statements.statement_file import parse_statement_file
from service.store import statement_log as entries
from service.store.batches.intake import accept_batch
from service.store.engine import Store
from service.store.grades import log_check
from service.store.purge import purge_submissions
from service.store.queue import jobs, self_tests
from service.store.states import Standing
from service.store.tables.grades import CriterionResultRow
from service.store.tables.people import Enrolment
from service.store.tables.statements import StatementEntry, StatementKey
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError

GRADE = report_builders.faulty_grade()
STUDENTS = ("ada", "bob", "cyd", "dee")


@dataclass(frozen=True, slots=True)
class Published:
    """A published batch: the jobs by student."""

    batch_id: str
    course_id: int
    jobs: dict[str, str]


@pytest.fixture
def published(store: Store) -> Published:
    """Publish the grades of four students, one after the other."""
    batch = accept_batch(store, "class", [grading_request(name) for name in STUDENTS], [], max_attempts=3).id
    _grade_all(store)
    with store.reading() as session:
        query = select(Enrolment.student, Enrolment.course_id, Job.id).join(Job, Job.enrolment_id == Enrolment.id)
        rows = session.execute(query).all()
    job_ids = {student: job_id for student, _, job_id in rows}
    for student in STUDENTS:
        acting.publish_one(store, job_ids[student])
    return Published(batch, rows[0][1], job_ids)


def _grade_all(store: Store, grade: Grade = GRADE) -> None:
    while (claim := jobs.claim_job(store, "worker", 60)) is not None:
        jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))


def _read_changes(store: Store) -> list[tuple[int, str, int | None]]:
    """Return number, change and replaced number of every entry; an empty change for an erased one."""
    with store.reading() as session:
        lines: list[tuple[int, str, int | None]] = []
        for row in session.scalars(select(StatementEntry).order_by(StatementEntry.number)):
            envelope = entries.read_envelope(row)
            predicate: Mapping[str, Any] = {"change": "", "replaces": None}
            if envelope:
                predicate = parse_statement(envelope).predicate
            lines.append((row.number, str(predicate["change"]), predicate["replaces"]))
        return lines


def _write_head(store: Store, start: int | None = None) -> FiledHead:
    return statement_log.write_head(acting.service_on(store), acting.machine(), start)


def _check(store: Store, *heads: FiledHead) -> LogReport:
    return statement_log.check_log(acting.service_on(store), acting.machine(), heads)


def _set_marks(store: Store, published: Published, student: str, marks: str = "0.5") -> None:
    request = MarksRequest(GRADE.criteria[0].id, Decimal(marks), "looked at it")
    service, actor = acting.service_on(store), acting.machine()
    grades.set_marks(service, actor, published.course_id, published.jobs[student], request)


def test_each_published_grade_has_an_entry_and_the_check_finds_nothing(store: Store, published: Published) -> None:
    assert _read_changes(store) == [(number, "published", None) for number in range(4)]
    report = _check(store, _write_head(store))
    assert (report.entries, report.grades, report.older_grades, report.findings) == (4, 4, 0, ())
    acting.publish(store, published.batch_id)
    assert len(_read_changes(store)) == 4


def test_changes_of_published_marks_append_entries_that_name_the_replaced_ones(
    store: Store, published: Published
) -> None:
    service, actor = acting.service_on(store), acting.machine()
    _set_marks(store, published, "ada")
    grades.withdraw_override(service, actor, published.course_id, published.jobs["ada"], GRADE.criteria[0].id)
    acting.regrade(store, published.batch_id, None, max_attempts=3, actor="staff")
    _grade_all(store)
    assert len(_read_changes(store)) == 6
    acting.publish(store, published.batch_id)
    assert _read_changes(store)[4:6] == [(4, "changed", 0), (5, "changed", 4)]
    assert sorted((change, replaced) for _, change, replaced in _read_changes(store)[6:]) == [
        ("changed", number) for number in (1, 2, 3, 5)
    ]
    assert _check(store).findings == ()


def test_marks_that_are_not_published_make_no_entry(store: Store) -> None:
    accept_batch(store, "class", [grading_request("ada")], [], max_attempts=3)
    _grade_all(store)
    with store.reading() as session:
        job_id, course_id = session.execute(
            select(Job.id, Enrolment.course_id).join(Enrolment, Job.enrolment_id == Enrolment.id)
        ).one()
    request = MarksRequest(GRADE.criteria[0].id, Decimal("0.5"), "looked at it")
    service = acting.service_on(store)
    grades.set_marks(service, acting.machine(), course_id, job_id, request)
    assert _read_changes(store) == []
    with pytest.raises(Conflict, match="when a grade is published"):
        statements.show_statement(service, acting.machine(), course_id, job_id)


def test_a_quarantine_withdraws_the_statements_of_its_grades(store: Store, published: Published) -> None:
    self_tests.quarantine_worker(store, "worker", "it adds wrongly")
    assert {(change, replaced) for _, change, replaced in _read_changes(store)[4:]} == {
        ("withdrawn", number) for number in range(4)
    }
    assert _check(store).findings == ()
    with pytest.raises(Conflict):
        statements.show_statement(
            acting.service_on(store), acting.machine(), published.course_id, published.jobs["ada"]
        )


def test_erasing_a_student_empties_the_entries_and_leaves_the_history_whole(store: Store, published: Published) -> None:
    _set_marks(store, published, "ada")
    head = _write_head(store)
    privacy.erase_student(acting.service_on(store), acting.machine(), published.course_id, _enrolment(store, "ada"))
    assert [change for _, change, _ in _read_changes(store)] == [
        "",
        "published",
        "published",
        "published",
        "",
        "erased",
    ]
    with store.reading() as session:
        for row in session.scalars(select(StatementEntry).where(StatementEntry.number.in_((0, 4)))):
            assert (row.salt, row.opening_key, row.payload, row.job_id, row.submission_id) == (None,) * 5
        erasure = entries.read_envelope(session.get_one(StatementEntry, 5))
        assert erasure is not None
    assert parse_statement(erasure).predicate["erased"] == [0, 4]
    assert b'"ada"' not in erasure.payload
    assert _check(store, head).findings == ()
    with store.transaction() as session:
        session.execute(update(StatementEntry).where(StatementEntry.number == 1).values(payload=None, salt=None))
    assert [each.entry for each in _check(store, head).findings] == [1]


def _enrolment(store: Store, student: str) -> int:
    with store.reading() as session:
        return session.scalars(select(Enrolment.id).where(Enrolment.student == student)).one()


def test_a_purge_erases_entries_too(store: Store, published: Published) -> None:
    purge_submissions(store, datetime.now(UTC) + timedelta(days=1), "staff")
    assert [change for _, change, _ in _read_changes(store)] == ["", "", "", "", "erased"]
    assert _check(store).findings == ()


def _change_marks(session: Session, job_id: str) -> None:
    session.execute(update(Job).where(Job.id == job_id).values(marks=Decimal(99)))


def _change_criterion(session: Session, job_id: str) -> None:
    row = CriterionResultRow
    session.execute(update(row).where(row.job_id == job_id, row.position == 0).values(marks=Decimal("0.125")))


def _remove_grade(session: Session, job_id: str) -> None:
    session.execute(delete(Job).where(Job.id == job_id))


def _unpublish(session: Session, job_id: str) -> None:
    session.execute(update(Job).where(Job.id == job_id).values(published_at=None))


def _remove_entry(session: Session, job_id: str) -> None:
    session.execute(delete(StatementEntry).where(StatementEntry.job_id == job_id))


def _rewrite_entry(row: StatementEntry, key: SigningKey, **changes: object) -> None:
    """Replace an entry with one that is signed with this key, as somebody with access to the database can."""
    envelope = entries.read_envelope(row)
    assert envelope is not None
    statement = parse_statement(envelope)
    forged = sign_statement(key, statement.predicate_type, statement.subjects, {**statement.predicate, **changes})
    row.key_id, row.signature, row.payload = forged.key_id, forged.signature.hex(), forged.payload
    row.leaf_sha256 = forged.hash_as_leaf(bytes.fromhex(row.salt or "")).hex()


def _forge_statement(session: Session, job_id: str) -> None:
    row = session.scalars(select(StatementEntry).where(StatementEntry.job_id == job_id)).one()
    _rewrite_entry(row, generate_signing_key(), student="eve")


def _back_date(session: Session, job_id: str) -> None:
    session.execute(
        update(StatementEntry).where(StatementEntry.job_id == job_id).values(made_at=datetime(2020, 1, 1, tzinfo=UTC))
    )


def _rename_student(session: Session, job_id: str) -> None:
    row = session.scalars(select(Enrolment).join(Job, Job.enrolment_id == Enrolment.id).where(Job.id == job_id)).one()
    row.student = "eve"


def _move_submission(session: Session, job_id: str) -> None:
    submission_id = select(Job.submission_id).where(Job.id == job_id).scalar_subquery()
    other_id = select(Enrolment.id).where(Enrolment.student == "dee").scalar_subquery()
    session.execute(
        update(SubmissionRow).where(SubmissionRow.id == submission_id).values(enrolment_id=other_id, attempt=2)
    )


def _show_elsewhere(session: Session, job_id: str) -> None:
    other_id = select(Enrolment.id).where(Enrolment.student == "dee").scalar_subquery()
    session.execute(update(Job).where(Job.id == job_id).values(enrolment_id=other_id))


def _set_submission(**values: Any) -> Callable[[Session, str], None]:
    def change(session: Session, job_id: str) -> None:
        submission_id = select(Job.submission_id).where(Job.id == job_id).scalar_subquery()
        session.execute(update(SubmissionRow).where(SubmissionRow.id == submission_id).values(**values))

    return change


def _detach_entry(session: Session, job_id: str) -> None:
    session.execute(update(StatementEntry).where(StatementEntry.job_id == job_id).values(submission_id=None))


TAMPERINGS: dict[str, tuple[Callable[[Session, str], None], str]] = {
    "total changed": (_change_marks, "its total is not that of entry 2"),
    "criterion changed": (_change_criterion, f"its criterion {GRADE.criteria[0].id} is not that of entry 2"),
    "grade removed": (_remove_grade, "of entry 2 was removed, or is no longer published"),
    "grade unpublished": (_unpublish, "of entry 2 was removed, or is no longer published"),
    "entry removed": (_remove_entry, "entry 2 was removed"),
    "statement forged": (_forge_statement, "entry 2 is not the one that was filed"),
    "entry detached": (_detach_entry, "entry 2 was altered: it refers to another grade than its statement"),
    "back-dated": (_back_date, "entry 2 was altered: its time is not that of its statement"),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", TAMPERINGS)
def test_tampering_is_named_against_filed_hashes(store: Store, published: Published, kind: str) -> None:
    head = _write_head(store)
    tamper, sentence = TAMPERINGS[kind]
    with store.transaction() as session:
        tamper(session, published.jobs["cyd"])
    findings = [each for each in _check(store, head).findings if "published without a statement" not in each.sentence]
    assert len(findings) == 1
    assert sentence in findings[0].sentence
    assert findings[0].entry == 2


def test_a_forged_or_back_dated_entry_after_the_filed_head_is_named(store: Store, published: Published) -> None:
    head = _write_head(store)
    _set_marks(store, published, "ada")
    with store.transaction() as session:
        row = session.get_one(StatementEntry, 4)
        row.made_at = datetime(2020, 1, 1, tzinfo=UTC)
        _rewrite_entry(row, entries.ensure_signing_key(session), issued_at="2020-01-01T00:00:00.000000Z")
    assert "entry 4 was back-dated" in _check(store, head).findings[0].sentence
    with store.transaction() as session:
        _rewrite_entry(session.get_one(StatementEntry, 4), generate_signing_key())
    assert "entry 4 was forged" in _check(store, head).findings[0].sentence


def test_a_head_without_its_hashes_says_that_history_differs(store: Store, published: Published) -> None:
    _write_head(store)
    _set_marks(store, published, "ada")
    late_head = _write_head(store)
    assert (late_head.start, late_head.size) == (4, 5)
    with store.transaction() as session:
        row = session.get_one(StatementEntry, 1)
        row.salt = "00" * 32
        _rewrite_entry(row, entries.ensure_signing_key(session))
    (finding,) = _check(store, late_head).findings
    assert finding.entry is None
    assert finding.sentence.startswith("the first 5 entries are not those of the head")


def _back_date_publication(session: Session, job_id: str) -> None:
    session.execute(update(Job).where(Job.id == job_id).values(published_at=datetime(2020, 1, 1, tzinfo=UTC)))


MOVES: dict[str, Callable[[Session, str], None]] = {
    "student": _rename_student,
    "student ": _move_submission,
    "student  ": _show_elsewhere,
    "attempt": _set_submission(attempt=7),
    "submission": _set_submission(sha256="0" * 64),
    "time of publication": _back_date_publication,
    "time of submission": _set_submission(submitted_at=datetime(2020, 1, 1, tzinfo=UTC)),
}


def test_a_grade_of_another_student_or_submission_is_named(store: Store, published: Published) -> None:
    for what, move in MOVES.items():
        with store.transaction() as session:
            savepoint = session.begin_nested()
            move(session, published.jobs["cyd"])
            session.flush()
            (finding,) = log_check.check_log(session, ()).findings
            savepoint.rollback()
        assert finding.sentence.endswith(f"was moved: its {what.strip()} is not that of entry 2")
    assert _check(store).findings == ()


def test_an_entry_between_two_heads_of_the_same_size_is_compared_with_both(store: Store, published: Published) -> None:
    early_head, late_head = _write_head(store), _write_head(store)
    _set_marks(store, published, "ada")
    with store.transaction() as session:
        row = session.get_one(StatementEntry, 4)
        row.made_at = datetime.fromisoformat(early_head.issued_at)
        _rewrite_entry(row, entries.ensure_signing_key(session), issued_at=early_head.issued_at)
    for heads in ((early_head, late_head), (late_head, early_head)):
        assert "entry 4 was back-dated" in _check(store, *heads).findings[0].sentence


def test_a_first_grade_without_an_entry_is_named(store: Store, published: Published) -> None:
    with store.transaction() as session:
        # The grades of one publication have the same time, which is before the log's first entry.
        first_time = session.scalars(select(Job.published_at).where(Job.id == published.jobs["ada"])).one()
        session.execute(update(Job).where(Job.id == published.jobs["dee"]).values(published_at=first_time))
        session.execute(delete(StatementEntry).where(StatementEntry.job_id == published.jobs["dee"]))
    report = _check(store)
    assert report.older_grades == 0
    assert report.findings[0].sentence.endswith("is published without a statement")


def test_a_gap_of_any_size_is_named(store: Store, published: Published) -> None:
    with store.transaction() as session:
        session.execute(insert(StatementEntry).values(number=2**31 - 1, leaf_sha256="", made_at=datetime.now(UTC)))
    findings = _check(store).findings
    assert (findings[0].entry, findings[0].sentence) == (4, "entry 4 was removed")
    sentences = [each.sentence for each in findings]
    assert f"entries {4 + 1000} to {2**31 - 2} were removed, too" in sentences
    assert len(findings) == 1000 + 2


def test_a_head_of_another_installation_is_refused(store: Store, published: Published) -> None:
    head = _write_head(store)
    with store.transaction() as session:
        session.execute(delete(StatementKey))
    with pytest.raises(UsageError, match="not signed by this installation"):
        _check(store, head)


def test_a_damaged_key_is_named(store: Store, published: Published) -> None:
    with store.transaction() as session:
        session.execute(update(StatementKey).values(public_hex="no digits"))
    with pytest.raises(UsageError, match="the public key is 'no digits', expected 64 hexadecimal digits"):
        statement_log.check_log(acting.service_on(store), acting.machine(), [])


def test_a_new_key_signs_and_a_revoked_one_is_named(store: Store, published: Published) -> None:
    service, actor = acting.service_on(store), acting.machine()
    head = _write_head(store)
    statements.rotate_key(service, actor)
    _set_marks(store, published, "ada")
    old_line, new_line = statements.list_keys(service)
    assert (old_line.is_current, new_line.is_current) == (False, True)
    assert _check(store, head).findings == ()
    statements.revoke_key(service, actor, new_line.key.id)
    with pytest.raises(UsageError, match="revoked already"):
        statements.revoke_key(service, actor, new_line.key.id)
    assert [each.entry for each in _check(store, head).findings] == [4]
    _set_marks(store, published, "bob")
    assert [line.is_current for line in statements.list_keys(service)] == [False, False, True]


def test_a_staff_copy_passes_all_checks_and_a_students_copy_has_no_trials(store: Store, published: Published) -> None:
    service, actor = acting.service_on(store), acting.machine()
    download = statements.show_statement(service, actor, published.course_id, published.jobs["ada"])
    file = parse_statement_file(download.data)
    assert check_statement(file, [line.key for line in statements.list_keys(service)]).passed
    assert {each.fact.kind.value for each in file.facts} == {"total", "criterion", "trial"}
    with store.reading() as session:
        row = session.scalars(select(Enrolment).where(Enrolment.student == "ada")).one()
        submission_id = session.scalars(select(Job.submission_id).where(Job.id == published.jobs["ada"])).one()
        student = replace(actor, operator=False, person_id=row.person_id)
    own_download = statements.show_own_statement(service, student, published.course_id, submission_id)
    own_file = parse_statement_file(own_download.data)
    assert check_statement(own_file, own_file.public_keys).passed
    assert {each.fact.kind.value for each in own_file.facts} <= {"total", "criterion"}
    assert (own_file.seeds, dict(own_file.columns)) == (None, {})
    assert b"seed" not in own_download.data
    receipt = parse_statement_file(
        statements.show_own_receipt(service, student, published.course_id, submission_id).data
    )
    checked = check_statement(receipt, [])
    assert checked.passed
    assert checked.statement.predicate["student"] == "ada"


def test_grades_published_before_the_log_began_are_counted(store: Store, published: Published) -> None:
    with store.transaction() as session:
        old = (Job.id == published.jobs["ada"], Job.standing == Standing.STANDS)
        session.execute(update(Job).where(*old).values(published_at=datetime(2020, 1, 1, tzinfo=UTC)))
        session.execute(delete(StatementEntry))
    report = _check(store)
    assert (report.older_grades, report.findings) == (4, ())


def test_damaged_entries_are_named(store: Store, published: Published) -> None:
    with store.transaction() as session:
        damages: list[dict[str, Any]] = [
            {"payload": b"{}"}, {"salt": "zz"}, {"leaf_sha256": "zz"}, {"opening_key": "zz"}
        ]  # fmt: skip
        for number, values in enumerate(damages):
            session.execute(update(StatementEntry).where(StatementEntry.number == number).values(**values))
        session.execute(
            insert(StatementEntry).values(number=9, leaf_sha256="00" * 32, made_at=datetime.now(UTC), salt="zz")
        )
    assert {each.entry for each in _check(store).findings} == {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}
