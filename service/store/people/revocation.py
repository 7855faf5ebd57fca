"""Validity of credentials, and their revocation with the sessions and tokens that were made with them."""

from __future__ import annotations

from datetime import datetime
from functools import cache

from sqlalchemy import ColumnElement, exists, or_, update
from sqlalchemy.orm import Session, aliased

from service.store.engine import now
from service.store.people.reach import UNLIMITED_REACH, Reach, match_reached_credentials
from service.store.states import CredentialKind
from service.store.tables.people import Credential


def match_valid(current_time: datetime | ColumnElement[datetime]) -> tuple[ColumnElement[bool], ...]:
    """Return the conditions on a ``Credential`` that can still be used."""
    is_unused = or_(Credential.kind != CredentialKind.LINK, Credential.used_at.is_(None))
    return Credential.revoked_at.is_(None), Credential.expires_at > current_time, is_unused, ~_match_revoked_parent()


def revoke_credential(session: Session, credential_id: str, person_id: int, reach: Reach = UNLIMITED_REACH) -> bool:
    """Revoke a credential. Returns False if this person does not have it within ``reach``."""
    conditions = (Credential.id == credential_id, Credential.person_id == person_id, Credential.revoked_at.is_(None))
    return revoke_matching(session, *conditions, *match_reached_credentials(reach)) == 1


def revoke_all(session: Session, person_id: int, *, kept_id: str = "", reach: Reach = UNLIMITED_REACH) -> int:
    """Revoke all links, sessions and tokens of a person within ``reach`` except one. Returns the number revoked."""
    conditions = (Credential.person_id == person_id, Credential.id != kept_id, *match_valid(now(session)))
    return revoke_matching(session, *conditions, *match_reached_credentials(reach))


def revoke_for_course(session: Session, person_id: int, course_id: int) -> int:
    """Revoke all credentials of a person that reach a course. Returns the number revoked."""
    has_reach = or_(Credential.course_id.is_(None), Credential.course_id == course_id)
    return revoke_matching(session, Credential.person_id == person_id, has_reach, *match_valid(now(session)))


def revoke_matching(session: Session, *conditions: ColumnElement[bool]) -> int:
    """Revoke credentials and everything made with them. Returns the number without what was made with them."""
    current_time = now(session)
    revoked_rows = session.execute(update(Credential).where(*conditions).values(revoked_at=current_time))
    revoke_derived = (
        update(Credential)
        .where(Credential.revoked_at.is_(None), _match_revoked_parent())
        .values(revoked_at=current_time)
    )
    while session.execute(revoke_derived, execution_options={"synchronize_session": False}).rowcount:  # type: ignore[attr-defined]
        pass
    return int(revoked_rows.rowcount)  # type: ignore[attr-defined]


@cache
def _match_revoked_parent() -> ColumnElement[bool]:
    """Return the condition that a credential was made with a token that is revoked.

    Every request uses it, and an alias of a table takes milliseconds to create.
    """
    token = aliased(Credential)
    return exists().where(token.id == Credential.token_id, token.revoked_at.is_not(None))
