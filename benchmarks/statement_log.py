"""Check of the log of 10,000 published grades, four of which were manipulated, against filed hashes, on both databases.

It measures real time, so run it on an idle machine: ``python -m benchmarks statement_log``.
"""

from __future__ import annotations

from datetime import UTC, datetime
from functools import partial

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from benchmarks import many_rows
from benchmarks.measurement import SECONDS, Measurement, measure_cpu_seconds, measure_wall_seconds, median
from benchmarks.rows import fill_databases, vacuum
from service.statements.keys import generate_signing_key
from service.statements.log_head import FiledHead, build_filed_head
from service.statements.merkle_tree import compute_root
from service.statements.statement import PredicateType, format_moment, parse_statement, sign_statement
from service.store.engine import Store, now
from service.store.grades.log_check import check_log
from service.store.grades.statements import state_publication
from service.store.statement_log import ensure_signing_key, load_leaves, read_envelope
from service.store.tables.grades import CriterionResultRow
from service.store.tables.statements import StatementEntry
from service.store.tables.submissions import Job

_GRADES = 10_000
#: Of so many grades one is published, because published grades are spread over all.
_STEP = 9
#: The numbers of the manipulated entries.
_CHANGED, _REMOVED, _BACK_DATED, _FORGED = 1234, 4321, 5678, 8765


def measure(times: int) -> list[Measurement]:
    """Measure the median time of a check. Raises RuntimeError unless it names exactly the four."""
    lines = []
    for database, store in fill_databases():
        head = _publish_grades(store)
        vacuum(store)
        with store.transaction() as session:
            _manipulate(session)
        named_entries = _check(store, head)
        if named_entries != [_CHANGED, _REMOVED, _BACK_DATED, _FORGED]:
            raise RuntimeError(f"the check names {named_entries}")
        check = partial(_check, store, head)
        seconds = [measure_wall_seconds(check) for _ in range(max(times, 3))]
        details = f"CPU {measure_cpu_seconds(check):.2f} s, most {max(seconds):.2f} s"
        title = f"{_GRADES:,} statements, {database}: four manipulations named"
        lines.append(Measurement(title, median(seconds), SECONDS, 1, details=details))
    return lines


def _check(store: Store, head: FiledHead) -> list[int]:
    """Return the entries that the check names."""
    with store.reading() as session:
        return sorted({finding.entry for finding in check_log(session, [head]).findings if finding.entry is not None})


def _publish_grades(store: Store) -> FiledHead:
    """Publish the first grades, and return the head of their log with all hashes."""
    job_ids = [many_rows.format_grade_name(_STEP * number) for number in range(_GRADES)]
    with store.transaction() as session:
        session.execute(update(Job).where(Job.id.in_(job_ids)).values(published_at=now(session)))
        state_publication(session, job_ids)
        leaves = load_leaves(session)
        predicate = {"size": len(leaves), "issued_at": format_moment(now(session))}
        subjects = {"log": compute_root(leaves).hex()}
        envelope = sign_statement(ensure_signing_key(session), PredicateType.LOG_HEAD, subjects, predicate)
        return build_filed_head(envelope, 0, leaves)


def _manipulate(session: Session) -> None:
    """Change a mark, remove a grade, back-date an entry and forge a statement."""
    row = CriterionResultRow
    is_changed = (row.job_id == many_rows.format_grade_name(_STEP * _CHANGED), row.position == 0)
    session.execute(update(row).where(*is_changed).values(marks=99))
    session.execute(delete(Job).where(Job.id == many_rows.format_grade_name(_STEP * _REMOVED)))
    is_back_dated = StatementEntry.number == _BACK_DATED
    session.execute(update(StatementEntry).where(is_back_dated).values(made_at=datetime(2020, 1, 1, tzinfo=UTC)))
    entry = session.scalars(select(StatementEntry).where(StatementEntry.number == _FORGED)).one()
    envelope = read_envelope(entry)
    assert envelope is not None
    statement = parse_statement(envelope)
    predicate = {**statement.predicate, "attempt": 9}
    forged = sign_statement(generate_signing_key(), statement.predicate_type, statement.subjects, predicate)
    entry.key_id, entry.signature, entry.payload = forged.key_id, forged.signature.hex(), forged.payload
    entry.leaf_sha256 = forged.hash_as_leaf(bytes.fromhex(entry.salt or "")).hex()
