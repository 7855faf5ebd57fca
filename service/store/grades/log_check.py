"""Check of the log of statements: against filed heads, against its own hashes and signatures, and against the grades.

A finding names the entry or grade. Nothing is changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.statements.envelopes import Envelope
from service.statements.facts import FactKind, OpenFact
from service.statements.keys import KeyLine
from service.statements.log_head import FiledHead
from service.statements.merkle_tree import compute_root
from service.statements.statement import PAYLOAD_TYPE, Change, Statement, format_moment, parse_statement
from service.store.grades.statements import load_marks_facts
from service.store.statement_log import list_keys
from service.store.states import JobState, Standing
from service.store.tables.courses import AssignmentVersion
from service.store.tables.people import Enrolment
from service.store.tables.statements import StatementEntry
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError

_CHUNK_SIZE = 500
#: Missing entries that are named one by one.
_MAX_NAMED_GAP = 1000
#: What a statement says of the submission, in the order of ``_Entry.submission``.
_SUBMISSION_PARTS = (
    "student",
    "assignment",
    "version of the assignment",
    "attempt",
    "time of submission",
    "time of publication",
    "submission",
)
_MARKS_KINDS = (FactKind.TOTAL, FactKind.CRITERION, FactKind.HIDDEN_CRITERION)
_MARKS_WORDS = tuple(kind.value for kind in _MARKS_KINDS)
_STATING_CHANGES = (None, Change.PUBLISHED.value, Change.CHANGED.value)

#: The published grades. Outer joins, because tampering may have removed the row of a submission or a student.
_SELECT_PUBLISHED = (
    select(
        Job.id, Job.submission_id, Job.published_at, (Job.enrolment_id == SubmissionRow.enrolment_id).label("is_own")
    )
    .add_columns(SubmissionRow.attempt, SubmissionRow.submitted_at, SubmissionRow.created_at, SubmissionRow.sha256)
    .add_columns(Enrolment.student, AssignmentVersion.assignment, AssignmentVersion.version)
    .outerjoin(SubmissionRow, Job.submission_id == SubmissionRow.id)
    .outerjoin(Enrolment, SubmissionRow.enrolment_id == Enrolment.id)
    .outerjoin(AssignmentVersion, Job.assignment_version_id == AssignmentVersion.id)
    .where(Job.standing == Standing.STANDS, Job.published_at.is_not(None), Job.state == JobState.DONE)
    .order_by(Job.id)
)


@dataclass(frozen=True, slots=True)
class LogFinding:
    """A finding on an entry, a grade, or the whole log."""

    entry: int | None
    grade: str | None
    sentence: str


@dataclass(frozen=True, slots=True)
class LogReport:
    """The result of a check: numbers of entries, of published grades, and of those published before the log began."""

    entries: int
    grades: int
    older_grades: int
    filed_heads: int
    findings: tuple[LogFinding, ...]


@dataclass(frozen=True, slots=True)
class _Entry:
    """What the check needs of a row of the log. The fields from ``entry`` on are from its statement, if it has one."""

    number: int
    leaf: bytes
    made_at: str
    submission_id: int | None
    job_id: str | None
    opening_key: bytes
    is_empty: bool
    problem: str  # of its content by itself
    change: Any = None
    issued_at: Any = None
    published_at: Any = None
    erased: tuple[int, ...] = ()
    commitments: Mapping[str, Any] = field(default_factory=dict)
    submission: tuple[Any, ...] = (None,) * len(_SUBMISSION_PARTS)


@dataclass(slots=True)
class _Findings:
    """Findings so far; an entry is named once, with the first reason."""

    items: list[LogFinding] = field(default_factory=list)
    named: set[int] = field(default_factory=set)

    def name_entry(self, number: int, sentence: str) -> None:
        if number not in self.named:
            self.named.add(number)
            self.items.append(LogFinding(number, None, f"entry {number} {sentence}"))

    def name_grade(self, entry: int | None, job_id: str, sentence: str) -> None:
        if entry is None or entry not in self.named:
            self.items.append(LogFinding(entry, job_id, f"grade {job_id} {sentence}"))


def check_log(session: Session, filed_heads: Sequence[FiledHead]) -> LogReport:
    """Check the log and the published grades. Reads all entries, and the marks of all published grades."""
    findings = _Findings()
    filed_leaves: dict[int, bytes] = {}
    for head in filed_heads:
        filed_leaves |= dict(enumerate(head.leaves, head.start))
    keys = {line.key.id: line for line in list_keys(session)}
    entries = list(_load_entries(session, filed_leaves, keys))
    _check_numbers(entries, max((head.size for head in filed_heads), default=0), findings)
    _compare_filed_leaves(entries, filed_heads, filed_leaves, findings)
    for entry in entries:
        if entry.problem:
            findings.name_entry(entry.number, entry.problem)
    _check_times(entries, filed_heads, findings)
    _check_erasures(entries, findings)
    grades, older_grades = _check_grades(session, entries, findings)
    return LogReport(len(entries), grades, older_grades, len(filed_heads), tuple(findings.items))


def _load_entries(session: Session, filed_leaves: Mapping[int, bytes], keys: Mapping[str, KeyLine]) -> Iterator[_Entry]:
    """Yield the entries by number. Signatures are checked where no hash was filed: they were checked before that."""
    row = StatementEntry
    columns = (row.number, row.leaf_sha256, row.made_at, row.submission_id, row.job_id)
    contents = (row.opening_key, row.salt, row.key_id, row.signature, row.payload)
    query = select(*columns, *contents).order_by(row.number)
    for (
        number,
        leaf_text,
        made_at,
        submission_id,
        job_id,
        opening_key,
        salt,
        key_id,
        signature,
        payload,
    ) in session.connection().execute(query, execution_options={"yield_per": _CHUNK_SIZE}):
        leaf = _read_hex(leaf_text)
        head = (number, leaf, format_moment(made_at), submission_id, job_id, _read_hex(opening_key))
        if payload is None:
            yield _Entry(*head, is_empty=True, problem="")
            continue
        envelope = Envelope(payload, PAYLOAD_TYPE, key_id or "", _read_hex(signature))
        try:
            statement = parse_statement(envelope)
        except UsageError:
            yield _Entry(*head, is_empty=False, problem="was altered: it contains no statement")
            continue
        problem = ""
        if envelope.hash_as_leaf(_read_hex(salt)) != leaf:
            problem = "was altered: its content is not that of its hash"
        elif statement.predicate.get("entry") != number:
            problem = "was moved: its statement has another number"
        elif statement.predicate.get("grade") != job_id or (submission_id is None) != (job_id is None):
            problem = "was altered: it refers to another grade than its statement"
        elif filed_leaves.get(number) != leaf:
            problem = _check_signature(envelope, keys.get(envelope.key_id))
        yield _Entry(*head, is_empty=False, problem=problem, **_summarise(statement))


def _summarise(statement: Statement) -> dict[str, Any]:
    """Return the fields of an entry that its statement has; the commitments without those to trials."""
    predicate = statement.predicate
    assignment = predicate.get("assignment", {})
    commitments, erased = predicate.get("commitments"), predicate.get("erased")
    listed = commitments if isinstance(commitments, dict) else {}
    return {
        "change": predicate.get("change"),
        "issued_at": predicate.get("issued_at"),
        "published_at": predicate.get("published_at"),
        "erased": tuple(each for each in erased if type(each) is int) if isinstance(erased, list) else (),
        "commitments": {kind: listed.get(kind) for kind in _MARKS_WORDS},
        "submission": (
            predicate.get("student"),
            assignment.get("id"),
            assignment.get("version"),
            predicate.get("attempt"),
            predicate.get("submitted_at"),
            predicate.get("published_at"),
            statement.subjects.get("submission"),
        ),
    }


def _check_signature(envelope: Envelope, line: KeyLine | None) -> str:
    if line is None or not envelope.is_signed_by(line.key):
        return "was forged: it is not signed with a key of this installation"
    if line.revoked_at is not None:
        return "may be forged: its key was revoked, and its hash was not filed"
    return ""


def _read_hex(text: str | None) -> bytes:
    """Return the bytes of hexadecimal digits; other text, which tampering may leave, gives no bytes."""
    try:
        return bytes.fromhex(text or "")
    except ValueError:
        return b""


def _check_numbers(entries: Sequence[_Entry], filed_size: int, findings: _Findings) -> None:
    """Name missing entries: the numbers have no gaps, and reach at least to the largest filed head."""
    next_number = 0
    for number in (*(entry.number for entry in entries), filed_size):
        first_unnamed = min(number, next_number + _MAX_NAMED_GAP)
        for missing_number in range(next_number, first_unnamed):
            findings.name_entry(missing_number, "was removed")
        if first_unnamed < number and next_number < number:
            sentence = f"entries {first_unnamed} to {number - 1} were removed, too"
            findings.items.append(LogFinding(None, None, sentence))
        next_number = max(next_number, number + 1)


def _compare_filed_leaves(
    entries: Sequence[_Entry],
    filed_heads: Sequence[FiledHead],
    filed_leaves: Mapping[int, bytes],
    findings: _Findings,
) -> None:
    """Name entries whose hash is not the filed one.

    Where hashes of earlier entries were not filed, a head only shows that the history differs.
    """
    for entry in entries:
        if filed_leaves.get(entry.number, entry.leaf) != entry.leaf:
            findings.name_entry(entry.number, "is not the one that was filed: it was altered or exchanged")
    leaves = [entry.leaf for entry in entries]
    for head in filed_heads:
        is_named = any(number < head.size for number in findings.named)
        if not is_named and compute_root(leaves[: head.size]) != head.root:
            findings.items.append(
                LogFinding(None, None, f"the first {head.size} entries are not those of the head of {head.issued_at}")
            )


def _check_times(entries: Sequence[_Entry], filed_heads: Sequence[FiledHead], findings: _Findings) -> None:
    """Name entries that are older than an earlier entry or than a head that was filed before them."""
    newest_time = ""
    head_times: dict[int, str] = {}
    for head in filed_heads:
        head_times[head.size] = max(head.issued_at, head_times.get(head.size, ""))
    for entry in entries:
        newest_time = max(newest_time, head_times.get(entry.number, ""))
        issued_at = entry.made_at
        if not entry.is_empty and entry.issued_at != issued_at:
            findings.name_entry(entry.number, "was altered: its time is not that of its statement")
        elif issued_at < newest_time:
            findings.name_entry(entry.number, f"was back-dated: {issued_at} is before {newest_time}")
        newest_time = max(newest_time, issued_at)


def _check_erasures(entries: Sequence[_Entry], findings: _Findings) -> None:
    """Name entries without content that no entry of an erasure names."""
    erased_numbers = {number for entry in entries if entry.change == Change.ERASED for number in entry.erased}
    for entry in entries:
        if entry.is_empty and entry.number not in erased_numbers:
            findings.name_entry(entry.number, "was emptied, and no entry says that its data was erased")


def _check_grades(session: Session, entries: Sequence[_Entry], findings: _Findings) -> tuple[int, int]:
    """Compare the published grades with their newest statements.

    Returns the number of published grades, and of those published before the first entry.
    """
    newest_entries = {entry.submission_id: entry for entry in entries if entry.submission_id is not None}
    # The first grades were published a moment before their entries.
    log_start = min(entries[0].made_at, str(entries[0].published_at or entries[0].made_at)) if entries else ""
    grades, older_grades, stated_jobs = 0, 0, []
    for row in session.connection().execute(_SELECT_PUBLISHED):
        grades += 1
        job_id, published_at = row.id, row.published_at
        entry = newest_entries.pop(row.submission_id, None)
        if entry is not None and entry.job_id == job_id and entry.change in _STATING_CHANGES:
            stated_jobs.append((job_id, entry))
            _compare_submission(row, entry, findings)
        elif entry is not None:
            findings.name_grade(entry.number, job_id, f"is published, but entry {entry.number} is on another grade")
        elif log_start and published_at is not None and format_moment(published_at) >= log_start:
            findings.name_grade(None, job_id, "is published without a statement")
        else:
            older_grades += 1
    for entry in newest_entries.values():
        if entry.change != Change.WITHDRAWN and entry.job_id is not None:
            sentence = f"of entry {entry.number} was removed, or is no longer published"
            findings.name_grade(entry.number, entry.job_id, sentence)
    for start in range(0, len(stated_jobs), _CHUNK_SIZE):
        _compare_marks(session, dict(stated_jobs[start : start + _CHUNK_SIZE]), findings)
    return grades, older_grades


def _compare_submission(row: Any, entry: _Entry, findings: _Findings) -> None:
    """Name a grade that is now of another student or submission than in its statement."""
    times = (format_moment(row.submitted_at or row.created_at), format_moment(row.published_at))
    actual = (row.student, row.assignment, row.version, row.attempt, *times, row.sha256)
    if actual == entry.submission and row.is_own:
        return
    pairs = zip(_SUBMISSION_PARTS, actual, entry.submission, strict=True)
    what = next((name for name, now, stated in pairs if now != stated), "student")
    findings.name_grade(entry.number, row.id, f"was moved: its {what} is not that of entry {entry.number}")


def _compare_marks(session: Session, entries_by_job: Mapping[str, _Entry], findings: _Findings) -> None:
    """Name grades whose marks are not those of their statements."""
    for job_id, facts in load_marks_facts(session, entries_by_job).items():
        entry = entries_by_job[job_id]
        actual, stated = facts.commit(entry.opening_key, *_MARKS_KINDS), entry.commitments
        if actual != stated:
            changed = next(kind for kind in _MARKS_KINDS if actual[kind.value] != stated.get(kind.value))
            what = _name_difference(facts.open_facts(entry.opening_key, changed), changed, stated.get(changed.value))
            findings.name_grade(entry.number, job_id, f"was changed: its {what} is not that of entry {entry.number}")


def _name_difference(facts: Sequence[OpenFact], kind: FactKind, stated: Any) -> str:
    """Return the name of the first fact of a kind whose commitment is not the stated one."""
    listed = stated if isinstance(stated, list) else []
    for each in facts:
        if kind is FactKind.CRITERION is each.fact.kind and listed[each.fact.number - 1 :][:1] != [each.commitment]:
            return f"criterion {each.fact.value['id']}"
    return kind.value
