"""The append-only log of signed statements, and the keys that sign them.

Entries are numbered without gaps, and nothing is removed: erasing a student's data empties entries and appends one that
names them. ``grades/statements.py`` builds the statements.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Select, func, select, update
from sqlalchemy.orm import Session

from service.statements.envelopes import Envelope
from service.statements.keys import KeyLine, SigningKey, generate_signing_key, parse_public_key
from service.statements.statement import (
    PAYLOAD_TYPE,
    Change,
    PredicateType,
    format_moment,
    name_entries,
    sign_statement,
)
from service.store.engine import now
from service.store.locks import lock_installation
from service.store.tables.statements import StatementEntry, StatementHead, StatementKey
from sim.errors import UsageError

_SALT_BYTES = 32
_CHUNK_SIZE = 500


@dataclass(frozen=True, slots=True)
class Draft:
    """A statement before it has a number. ``predicate`` and ``subjects`` as in ``build_payload``."""

    change: Change
    subjects: Mapping[str, str]
    predicate: Mapping[str, Any]
    submission_id: int | None = None
    job_id: str | None = None
    opening_key: bytes | None = None


def append_entries(session: Session, drafts: Sequence[Draft]) -> None:
    """Append statements to the log, signed, in one order for all transactions.

    Each names the entry of its submission that it replaces. Must be the last change of a transaction that takes locks.
    """
    if not drafts:
        return
    session.flush()
    key = ensure_signing_key(session)
    number = count_entries(session)
    current_time = max(now(session), _load_newest_time(session) or datetime.min.replace(tzinfo=UTC))
    replaced_numbers = _load_newest_numbers(session, [each.submission_id for each in drafts])
    for draft in drafts:
        replaced_number = replaced_numbers.get(draft.submission_id)
        is_change = draft.change is Change.PUBLISHED and replaced_number is not None
        predicate = {
            "entry": number,
            "change": (Change.CHANGED if is_change else draft.change).value,
            "replaces": replaced_number,
            "issued_at": format_moment(current_time),
            **draft.predicate,
        }
        salt = secrets.token_bytes(_SALT_BYTES)
        envelope = sign_statement(key, PredicateType.GRADE, draft.subjects, predicate)
        session.add(
            StatementEntry(
                number=number,
                leaf_sha256=envelope.hash_as_leaf(salt).hex(),
                made_at=current_time,
                submission_id=draft.submission_id,
                job_id=draft.job_id,
                salt=salt.hex(),
                opening_key=None if draft.opening_key is None else draft.opening_key.hex(),
                key_id=envelope.key_id,
                signature=envelope.signature.hex(),
                payload=envelope.payload,
            )
        )
        number += 1
    session.flush()


def erase_entries(session: Session, submission_ids: Select[int]) -> None:
    """Empty the entries of submissions that are being removed, and append one that names them."""
    is_erased = StatementEntry.submission_id.in_(submission_ids)
    query = select(StatementEntry.number, StatementEntry.leaf_sha256).where(is_erased).order_by(StatementEntry.number)
    erased_entries = [(number, leaf) for number, leaf in session.execute(query)]
    if not erased_entries:
        return
    statement = (
        update(StatementEntry)
        .where(is_erased)
        .values(submission_id=None, job_id=None, salt=None, opening_key=None, key_id=None, signature=None, payload=None)
    )
    session.execute(statement.execution_options(synchronize_session=False))
    append_entries(
        session,
        [
            Draft(
                Change.ERASED,
                name_entries(erased_entries[start : start + _CHUNK_SIZE]),
                {"erased": [number for number, _ in erased_entries[start : start + _CHUNK_SIZE]]},
            )
            for start in range(0, len(erased_entries), _CHUNK_SIZE)
        ],
    )


def count_entries(session: Session) -> int:
    """Return the number of the next entry."""
    newest_number = session.scalar(select(func.max(StatementEntry.number)))
    return 0 if newest_number is None else newest_number + 1


def _load_newest_time(session: Session) -> datetime | None:
    """Return the time of the newest entry, so that no entry is older when a clock was set back."""
    return session.scalar(select(StatementEntry.made_at).order_by(StatementEntry.number.desc()).limit(1))


def load_leaves(session: Session) -> list[bytes]:
    """Return the leaf hashes of all entries."""
    query = select(StatementEntry.leaf_sha256).order_by(StatementEntry.number)
    return [bytes.fromhex(leaf) for leaf in session.scalars(query)]


def read_envelope(entry: StatementEntry) -> Envelope | None:
    """Return the envelope of an entry; None if its data was erased."""
    if entry.payload is None or entry.signature is None or entry.key_id is None:
        return None
    return Envelope(entry.payload, PAYLOAD_TYPE, entry.key_id, bytes.fromhex(entry.signature))


def load_newest_entry(session: Session, submission_id: int) -> StatementEntry | None:
    """Return the newest entry on a submission; None if no grade of it was published."""
    query = select(StatementEntry).where(StatementEntry.submission_id == submission_id)
    return session.scalar(query.order_by(StatementEntry.number.desc()).limit(1))


def load_newest_head_size(session: Session) -> int:
    """Return the number of entries at the last head that was written, 0 without one."""
    return session.scalar(select(StatementHead.size).order_by(StatementHead.id.desc()).limit(1)) or 0


def record_head(session: Session, size: int, root: bytes) -> None:
    """Record that a head was written."""
    session.add(StatementHead(size=size, root_sha256=root.hex(), made_at=now(session)))


def find_signing_key(session: Session) -> SigningKey | None:
    """Return the current key; None if there is none yet."""
    private_hex = session.scalar(_select_current(StatementKey.private_hex).limit(1))
    return None if private_hex is None else SigningKey(private_hex)


def ensure_signing_key(session: Session) -> SigningKey:
    """Return the current key, creating one if there is none. The log is locked until the end of the transaction."""
    lock_installation(session)
    return find_signing_key(session) or _add_key(session)


def rotate_key(session: Session) -> KeyLine:
    """Retire the current key and return its new successor. Earlier signatures remain valid."""
    lock_installation(session)
    current_time = now(session)
    for row in session.scalars(_select_current(StatementKey)):
        row.retired_at, row.private_hex = current_time, None
    session.flush()
    return find_key(session, _add_key(session).public_key.id)


def revoke_key(session: Session, key_id: str) -> KeyLine:
    """Revoke a key that others may know. Signatures of statements that were not filed before are then worthless.

    Raises UsageError for an unknown or revoked key.
    """
    lock_installation(session)
    row = session.get(StatementKey, key_id)
    if row is None or row.revoked_at is not None:
        state = "unknown" if row is None else "revoked already"
        raise UsageError("the key %(key)s is %(state)s", key=repr(key_id[:40]), state=state)
    row.revoked_at, row.private_hex = now(session), None
    session.flush()
    return find_key(session, key_id)


def list_keys(session: Session) -> list[KeyLine]:
    """Return all keys, oldest first."""
    return [_build_line(row) for row in session.scalars(select(StatementKey).order_by(StatementKey.created_at))]


def find_key(session: Session, key_id: str) -> KeyLine:
    """Return the key with this id. Raises NoResultFound."""
    return _build_line(session.get_one(StatementKey, key_id))


def _build_line(row: StatementKey) -> KeyLine:
    return KeyLine(parse_public_key(row.public_hex), row.created_at, row.retired_at, row.revoked_at)


def _select_current(what: Any) -> Select[Any]:
    is_current = (StatementKey.retired_at.is_(None), StatementKey.revoked_at.is_(None))
    return select(what).where(*is_current).order_by(StatementKey.created_at.desc())


def _add_key(session: Session) -> SigningKey:
    key = generate_signing_key()
    public_key = key.public_key
    row = StatementKey(id=public_key.id, public_hex=public_key.hex, private_hex=key.hex, created_at=now(session))
    session.add(row)
    session.flush()
    return key


def _load_newest_numbers(session: Session, submission_ids: Iterable[int | None]) -> dict[int | None, int]:
    """Return the number of the newest entry of each submission that has one."""
    ids = [each for each in submission_ids if each is not None]
    numbers: dict[int | None, int] = {}
    for start in range(0, len(ids), _CHUNK_SIZE):
        query = select(StatementEntry.submission_id, func.max(StatementEntry.number))
        query = query.where(StatementEntry.submission_id.in_(ids[start : start + _CHUNK_SIZE]))
        numbers |= dict(session.execute(query.group_by(StatementEntry.submission_id)).all())
    return numbers
