"""Credentials: single-use sign-in links, browser sessions and API tokens, with the reach of each.

Only hashes of secrets are stored. ``revocation.py`` revokes credentials, and the web service decides what each role
permits.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import and_, delete, func, select, true, update
from sqlalchemy.orm import Session

from service.store.conditional_insert import insert_if_new
from service.store.engine import now, select_clock
from service.store.ids import generate_id
from service.store.people.reach import (
    UNLIMITED_REACH,
    Reach,
    build_reach,
    build_reach_columns,
    match_reached_credentials,
    match_reached_enrolments,
)
from service.store.people.revocation import match_valid, revoke_matching
from service.store.states import CredentialKind, Role
from service.store.tables.people import Credential, Enrolment, Person

SESSION_LIFETIME = timedelta(days=7)
LINK_LIFETIME = timedelta(days=2)
#: Per person: a new session ends the oldest one; further tokens are rejected.
MAX_SESSIONS, MAX_TOKENS = 20, 20
#: Prefixes of secrets, so that a leaked one can be recognised.
_PREFIXES = {CredentialKind.LINK: "rml_", CredentialKind.SESSION: "rms_", CredentialKind.TOKEN: "rmt_"}
_RETENTION = timedelta(days=30)
_USE_INTERVAL = timedelta(hours=1)


@dataclass(frozen=True, slots=True)
class Identity:
    """The owner of a valid secret, within its reach. ``scopes`` is None for a browser session without a scope limit."""

    credential_id: str
    person_id: int
    name: str
    operator: bool
    roles: Mapping[int, Role]  # by course
    scopes: frozenset[str] | None
    reach: Reach
    use_is_noted: bool  # within the last hour


@dataclass(frozen=True, slots=True)
class NewSession:
    """The secret of a new browser session, and its lifetime."""

    secret: str
    lifetime: timedelta = SESSION_LIFETIME


@dataclass(frozen=True, slots=True)
class LinkOwner:
    """The person that a valid link signs in, and its expiry time."""

    person_id: int
    name: str
    expires_at: datetime


@dataclass(frozen=True, slots=True)
class CredentialLine:
    """A session or a token, as its owner sees it."""

    id: str
    kind: CredentialKind
    name: str
    scopes: tuple[str, ...]
    course_id: int | None
    created_at: datetime
    expires_at: datetime
    used_at: datetime | None


def issue_credential(
    session: Session,
    person_id: int,
    kind: CredentialKind,
    lifetime: timedelta,
    *,
    name: str = "",
    reach: Reach = UNLIMITED_REACH,
    token: Credential | None = None,
) -> str:
    """Issue a new secret for this person, and delete credentials that expired long ago.

    A session that is started with a ``token`` ends with it.
    """
    current_time = now(session)
    _delete_expired(session, current_time)
    secret = _PREFIXES[kind] + secrets.token_urlsafe(32)
    expires_at, token_id = current_time + lifetime, None
    if token is not None:
        expires_at, token_id = min(expires_at, token.expires_at), token.id
    session.add(
        _build_row(
            person_id,
            kind,
            secret,
            current_time,
            expires_at,
            name=name,
            token_id=token_id,
            **build_reach_columns(reach),
        )
    )
    session.flush()
    if kind is not CredentialKind.LINK:
        _record_sign_in(session, person_id, current_time)
    if kind is CredentialKind.SESSION:
        _end_oldest_sessions(session, person_id, current_time)
    return secret


def create_token(
    session: Session,
    person_id: int,
    lifetime: timedelta,
    random_word: str,
    *,
    name: str,
    reach: Reach = UNLIMITED_REACH,
    parent_token_id: str = "",
) -> None:
    """Create a token of this person from an unguessable word. Repeating the call creates no second token.

    If ``parent_token_id`` is the id of a session that was started with a token, the new token ends with that token.
    """
    current_time = now(session)
    _delete_expired(session, current_time)
    _record_sign_in(session, person_id, current_time)
    expires_at, token = current_time + lifetime, _find_parent_token(session, parent_token_id)
    if token is not None:
        expires_at = min(expires_at, token.expires_at)
    insert_if_new(
        session,
        Credential,
        id=generate_id(),
        person_id=person_id,
        kind=CredentialKind.TOKEN,
        sha256=_hash_secret(_PREFIXES[CredentialKind.TOKEN] + random_word),
        name=name,
        created_at=current_time,
        expires_at=expires_at,
        token_id=None if token is None else token.id,
        **build_reach_columns(reach),
    )


def _find_parent_token(session: Session, credential_id: str) -> Credential | None:
    """Return the token that a session was started with; None if it was started in another way."""
    row = session.get(Credential, credential_id)
    return None if row is None or row.token_id is None else session.get_one(Credential, row.token_id)


def find_unused_token(session: Session, person_id: int, word: str) -> str:
    """Return the secret of the token created from this word if it is not used yet, otherwise an empty string."""
    secret = _PREFIXES[CredentialKind.TOKEN] + word
    row = _find_valid(session, secret, CredentialKind.TOKEN)
    return "" if row is None or row.person_id != person_id or row.used_at is not None else secret


def count_tokens(session: Session, person_id: int) -> int:
    """Return the number of a person's valid tokens and lock the person until the end of the transaction."""
    session.get_one(Person, person_id, with_for_update={"key_share": True})
    query = select(func.count()).where(Credential.person_id == person_id, Credential.kind == CredentialKind.TOKEN)
    return session.scalar(query.where(*match_valid(now(session)))) or 0


def replace_links(
    session: Session, person_ids: Sequence[int], lifetime: timedelta, word: str = "", reach: Reach = UNLIMITED_REACH
) -> dict[int, str]:
    """Create a new link for each of these persons and return the secrets; their earlier links are revoked.

    An unguessable ``word`` determines the secret for a single person, so that the caller can reproduce it.
    """
    current_time = now(session)
    _delete_expired(session, current_time)
    links = (Credential.kind == CredentialKind.LINK, Credential.revoked_at.is_(None))
    session.execute(
        update(Credential).where(*links, Credential.person_id.in_(person_ids)).values(revoked_at=current_time)
    )
    secrets_by_person = {person_id: build_link_secret(word or secrets.token_urlsafe(32)) for person_id in person_ids}
    limits = build_reach_columns(reach)
    session.add_all(
        _build_row(who, CredentialKind.LINK, secret, current_time, current_time + lifetime, **limits)
        for who, secret in secrets_by_person.items()
    )
    session.flush()
    return secrets_by_person


def build_link_secret(word: str) -> str:
    """Return the secret of a link created from this word."""
    return _PREFIXES[CredentialKind.LINK] + word


def find_link_owner(session: Session, link: str) -> LinkOwner | None:
    """Return the person that the link signs in; None if it is invalid or expired."""
    row = _find_valid(session, link, CredentialKind.LINK)
    if row is None:
        return None
    query = select(Enrolment.name, Enrolment.written).where(Enrolment.person_id == row.person_id)
    if row.course_id is not None:
        query = query.where(Enrolment.course_id == row.course_id)
    names = session.execute(query.order_by(Enrolment.role != Role.INSTRUCTOR, Enrolment.id)).all()
    return LinkOwner(row.person_id, _choose_name(row.person_id, names), row.expires_at)


def can_sign_in(session: Session, secret: str) -> bool:
    """Whether the secret is a valid link, or a valid token that permits browser sign-in."""
    link = _find_valid(session, secret, CredentialKind.LINK)
    return link is not None or _find_sign_in_token(session, secret) is not None


def redeem_link(session: Session, link: str) -> NewSession | None:
    """Exchange a link for a new session with the same reach. None if the link is not valid."""
    row = _find_valid(session, link, CredentialKind.LINK)
    if row is None:
        return None
    current_time = now(session)
    statement = (
        update(Credential).where(Credential.id == row.id, Credential.used_at.is_(None)).values(used_at=current_time)
    )
    if session.execute(statement).rowcount != 1:  # type: ignore[attr-defined]
        return None
    return NewSession(
        issue_credential(session, row.person_id, CredentialKind.SESSION, SESSION_LIFETIME, reach=build_reach(row))
    )


def start_session(session: Session, token: str) -> NewSession | None:
    """Start a session with the reach of a token, which ends with the token.

    Returns None if the token does not permit browser sign-in.
    """
    row = _find_sign_in_token(session, token)
    if row is None:
        return None
    kind, lifetime = CredentialKind.SESSION, min(SESSION_LIFETIME, row.expires_at - now(session))
    return NewSession(
        issue_credential(session, row.person_id, kind, lifetime, reach=build_reach(row), token=row), lifetime
    )


def identify(session: Session, secret: str, kind: CredentialKind) -> Identity | None:
    """Return the owner of a session or token, with the roles within its reach. None if it is not valid."""
    row = _find_valid(session, secret, kind)
    if row is None:
        return None
    reach = build_reach(row)
    reach_conditions = match_reached_enrolments(reach)
    is_reached = and_(*reach_conditions) if reach_conditions else true()
    query = select(Person.operator, Enrolment, is_reached, select_clock(session))
    query = query.outerjoin(Enrolment, Enrolment.person_id == Person.id).where(Person.id == row.person_id)
    enrolment_rows = session.execute(query.order_by(Enrolment.role != Role.INSTRUCTOR, Enrolment.id)).all()
    enrolments = [(enrolment, is_reached) for _, enrolment, is_reached, _ in enrolment_rows if enrolment is not None]
    own_enrolments = [each for each, _ in enrolments if row.course_id in (None, each.course_id)]
    return Identity(
        row.id,
        row.person_id,
        _choose_name(row.person_id, [(each.name, each.written) for each in own_enrolments]),
        enrolment_rows[0][0] and reach.is_unlimited,
        {each.course_id: each.role for each, is_reached in enrolments if is_reached},
        None if kind is CredentialKind.SESSION and not reach.scopes else reach.scopes,
        reach,
        row.used_at is not None and row.used_at >= enrolment_rows[0][3] - _USE_INTERVAL,
    )


def record_use(session: Session, credential_id: str) -> None:
    """Record the use of a token, at most once an hour."""
    current_time = now(session)
    row = session.get(Credential, credential_id)
    if row is not None and (row.used_at is None or row.used_at < current_time - _USE_INTERVAL):
        row.used_at = current_time


def list_credentials(session: Session, person_id: int, reach: Reach = UNLIMITED_REACH) -> list[CredentialLine]:
    """Return a person's valid sessions and tokens within ``reach``, newest first."""
    is_listed_kind = Credential.kind.in_([CredentialKind.SESSION, CredentialKind.TOKEN])
    conditions = (
        Credential.person_id == person_id,
        is_listed_kind,
        *match_valid(now(session)),
        *match_reached_credentials(reach),
    )
    return [
        CredentialLine(
            row.id, row.kind, row.name, tuple(row.scopes), row.course_id, row.created_at, row.expires_at, row.used_at
        )
        for row in session.scalars(
            select(Credential).where(*conditions).order_by(Credential.created_at.desc(), Credential.id)
        )
    ]


def _choose_name(person_id: int, names_and_ids: Sequence[tuple[str, str]]) -> str:
    """Return the first name among a person's enrolments, otherwise the first id there, otherwise the person's id."""
    names = [name for name, _ in names_and_ids if name] or [written for _, written in names_and_ids if written]
    return names[0] if names else f"person {person_id}"


def _record_sign_in(session: Session, person_id: int, current_time: datetime) -> None:
    session.execute(
        update(Person).where(Person.id == person_id, Person.signed_in_at.is_(None)).values(signed_in_at=current_time)
    )


def _end_oldest_sessions(session: Session, person_id: int, current_time: datetime) -> None:
    conditions = (
        Credential.person_id == person_id,
        Credential.kind == CredentialKind.SESSION,
        *match_valid(current_time),
    )
    newest_query = select(Credential.id).where(*conditions).order_by(Credential.created_at.desc(), Credential.id)
    kept_ids = list(session.scalars(newest_query.limit(MAX_SESSIONS)))
    revoke_matching(session, *conditions, Credential.id.not_in(kept_ids))


def _find_sign_in_token(session: Session, token: str) -> Credential | None:
    row = _find_valid(session, token, CredentialKind.TOKEN)
    return row if row is not None and "sign-in" in row.scopes else None


def _find_valid(session: Session, secret: str, kind: CredentialKind) -> Credential | None:
    if not secret.startswith(_PREFIXES[kind]) or len(secret) > 100:
        return None
    conditions = (Credential.sha256 == _hash_secret(secret), Credential.kind == kind)
    return session.scalar(select(Credential).where(*conditions, *match_valid(select_clock(session))))


def _build_row(
    person_id: int, kind: CredentialKind, secret: str, current_time: datetime, expires_at: datetime, **columns: Any
) -> Credential:
    return Credential(
        person_id=person_id,
        kind=kind,
        sha256=_hash_secret(secret),
        created_at=current_time,
        expires_at=expires_at,
        **columns,
    )


def _delete_expired(session: Session, current_time: datetime) -> None:
    """Delete credentials that expired long ago.

    Tokens are kept, because stored replies refer to them. The activity log names people, not credentials.
    """
    is_expired = (Credential.expires_at < current_time - _RETENTION, Credential.kind != CredentialKind.TOKEN)
    session.execute(delete(Credential).where(*is_expired))


def _hash_secret(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
