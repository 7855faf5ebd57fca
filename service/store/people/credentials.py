"""How people sign in: links that count once, sessions of browsers, tokens of programs; and whom each stands for.

Only hashes of secrets are kept. What somebody may do with a role is the web's to say.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.ids import new_id
from service.store.inserting import insert_if_new
from service.store.models import Enrolment, Person
from service.store.states import CredentialKind, Role
from service.store.web_tables import Credential

SESSION_LIFETIME = timedelta(days=7)
LINK_LIFETIME = timedelta(days=2)
#: Ahead of a secret, so that one that was left lying about is known for what it is.
_PREFIXES = {CredentialKind.LINK: "rml_", CredentialKind.SESSION: "rms_", CredentialKind.TOKEN: "rmt_"}
_FORGOTTEN = timedelta(days=30)
_NOTED_EVERY = timedelta(hours=1)


@dataclass(frozen=True, slots=True)
class Identity:
    """Somebody who showed a secret that counts. ``scopes`` is None for a browser, which may do all its owner may."""

    credential_id: str
    person_id: int
    name: str
    operator: bool
    roles: Mapping[int, Role]  # by course
    scopes: frozenset[str] | None


@dataclass(frozen=True, slots=True)
class LinkOwner:
    """Whom a link that counts would sign in, and how long yet."""

    person_id: int
    name: str
    expires_at: datetime


@dataclass(frozen=True, slots=True)
class TokenLine:
    """A token, as its owner sees it."""

    id: str
    name: str
    scopes: tuple[str, ...]
    course_id: int | None
    created_at: datetime
    expires_at: datetime
    used_at: datetime | None


def issue(
    session: Session,
    person_id: int,
    kind: CredentialKind,
    lifetime: timedelta,
    *,
    name: str = "",
    scopes: Iterable[str] = (),
    course_id: int | None = None,
) -> str:
    """A new secret of this person. It is told this once; what has long expired is forgotten."""
    at = now(session)
    _forget_expired(session, at)
    secret = _PREFIXES[kind] + secrets.token_urlsafe(32)
    session.add(_row(person_id, kind, secret, at, at + lifetime, name=name, scopes=sorted(scopes), course_id=course_id))
    session.flush()
    return secret


def make_token(
    session: Session, person_id: int, lifetime: timedelta, word: str, *, name: str, scopes: Iterable[str]
) -> None:
    """A token of this person made of a word that nobody can guess: one, however often the same is asked for."""
    at = now(session)
    _forget_expired(session, at)
    insert_if_new(
        session,
        Credential,
        id=new_id(),
        person_id=person_id,
        kind=CredentialKind.TOKEN,
        sha256=_sha256(_PREFIXES[CredentialKind.TOKEN] + word),
        name=name,
        scopes=sorted(scopes),
        created_at=at,
        expires_at=at + lifetime,
    )


def unused_token(session: Session, person_id: int, word: str) -> str:
    """The secret of a person's token that was made of this word, until it is used first; else empty."""
    secret = _PREFIXES[CredentialKind.TOKEN] + word
    row = _valid(session, secret, CredentialKind.TOKEN)
    return "" if row is None or row.person_id != person_id or row.used_at is not None else secret


def replace_links(session: Session, person_ids: Sequence[int], lifetime: timedelta, word: str = "") -> dict[int, str]:
    """The secret of a new link of each of these persons; those that they had count no more.

    A ``word`` that nobody can guess makes that of one, so that it can be told again by whoever has the word.
    """
    at = now(session)
    _forget_expired(session, at)
    links = (Credential.kind == CredentialKind.LINK, Credential.revoked_at.is_(None))
    session.execute(update(Credential).where(*links, Credential.person_id.in_(person_ids)).values(revoked_at=at))
    made = {person_id: link_of(word or secrets.token_urlsafe(32)) for person_id in person_ids}
    session.add_all(_row(who, CredentialKind.LINK, secret, at, at + lifetime) for who, secret in made.items())
    session.flush()
    return made


def link_of(word: str) -> str:
    """The secret of a link that was made of this word."""
    return _PREFIXES[CredentialKind.LINK] + word


def owner(session: Session, link: str) -> LinkOwner | None:
    """Who would be signed in by the link; None where it does not count, or not any more."""
    row = _valid(session, link, CredentialKind.LINK)
    return None if row is None else LinkOwner(row.person_id, person_name(session, row.person_id), row.expires_at)


def redeem(session: Session, link: str) -> str | None:
    """The secret of a new session in exchange for a link's, which counts no more; None where it does not count."""
    row = _valid(session, link, CredentialKind.LINK)
    if row is None:
        return None
    at = now(session)
    taken = update(Credential).where(Credential.id == row.id, Credential.used_at.is_(None)).values(used_at=at)
    if session.execute(taken).rowcount != 1:  # type: ignore[attr-defined]
        return None
    return issue(session, row.person_id, CredentialKind.SESSION, SESSION_LIFETIME)


def identify(session: Session, secret: str, kind: CredentialKind) -> Identity | None:
    """Whom a session or a token stands for; None where it does not count. A token may be kept to one course."""
    row = _valid(session, secret, kind)
    if row is None:
        return None
    person = session.get_one(Person, row.person_id)
    query = select(Enrolment.course_id, Enrolment.role).where(Enrolment.person_id == person.id)
    roles = {course_id: role for course_id, role in session.execute(query) if row.course_id in (None, course_id)}
    return Identity(
        row.id,
        person.id,
        person_name(session, person.id),
        person.operator and row.course_id is None,
        roles,
        None if kind is CredentialKind.SESSION else frozenset(row.scopes),
    )


def note_use(session: Session, credential_id: str) -> None:
    """Write down that a token was used; once an hour is enough."""
    at = now(session)
    row = session.get(Credential, credential_id)
    if row is not None and (row.used_at is None or row.used_at < at - _NOTED_EVERY):
        row.used_at = at


def revoke(session: Session, credential_id: str, person_id: int) -> bool:
    """From now on the secret does not count; false where this person has none of this id."""
    row = session.get(Credential, credential_id)
    if row is None or row.person_id != person_id or row.revoked_at is not None:
        return False
    row.revoked_at = now(session)
    return True


def tokens(session: Session, person_id: int) -> list[TokenLine]:
    """The tokens of a person that count, the newest first."""
    query = (
        select(Credential)
        .where(
            Credential.person_id == person_id,
            Credential.kind == CredentialKind.TOKEN,
            Credential.revoked_at.is_(None),
            Credential.expires_at > now(session),
        )
        .order_by(Credential.created_at.desc(), Credential.id)
    )
    return [
        TokenLine(row.id, row.name, tuple(row.scopes), row.course_id, row.created_at, row.expires_at, row.used_at)
        for row in session.scalars(query)
    ]


def person_name(session: Session, person_id: int) -> str:
    """What a person is called: by name, else as a course knows them."""
    person = session.get_one(Person, person_id)
    if person.name:
        return person.name
    known = select(Enrolment.written).where(Enrolment.person_id == person_id).order_by(Enrolment.id).limit(1)
    return session.scalar(known) or f"person {person_id}"


def _valid(session: Session, secret: str, kind: CredentialKind) -> Credential | None:
    if not secret.startswith(_PREFIXES[kind]) or len(secret) > 100:
        return None
    row = session.scalar(select(Credential).where(Credential.sha256 == _sha256(secret), Credential.kind == kind))
    if row is None or row.revoked_at is not None or row.expires_at <= now(session):
        return None
    return None if kind is CredentialKind.LINK and row.used_at is not None else row


def _row(
    person_id: int, kind: CredentialKind, secret: str, at: datetime, expires_at: datetime, **told: Any
) -> Credential:
    return Credential(
        person_id=person_id, kind=kind, sha256=_sha256(secret), created_at=at, expires_at=expires_at, **told
    )


def _forget_expired(session: Session, at: datetime) -> None:
    """What a reply was kept for goes with it, and an audit names people, not secrets."""
    expired = (Credential.expires_at < at - _FORGOTTEN, Credential.kind != CredentialKind.TOKEN)
    session.execute(delete(Credential).where(*expired))


def _sha256(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
