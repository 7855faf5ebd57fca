"""Sign-in, sign-out, and identification of the owner of a session or token.

``credentials.py`` manages the sessions and tokens of a person.
"""

from __future__ import annotations

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.store.people import credentials, revocation
from service.store.people.credentials import Identity as Identity
from service.store.people.credentials import LinkOwner
from service.store.people.credentials import NewSession as NewSession
from service.store.states import CredentialKind


def identify(service: Service, secret: str, kind: CredentialKind) -> Identity | None:
    """Return the owner of a session or token, with the roles within its reach. None if it is not valid."""
    with service.store.reading() as session:
        return credentials.identify(session, secret, kind)


def record_use(service: Service, identity: Identity) -> None:
    """Record that a token was used."""
    with service.store.transaction() as session:
        credentials.record_use(session, identity.credential_id)


def find_link_owner(service: Service, link: str) -> LinkOwner | None:
    """Return the person that a link signs in. None if the link is not valid."""
    with service.store.reading() as session:
        return credentials.find_link_owner(session, link)


def sign_in(service: Service, actor: Actor | None, secret: str) -> NewSession | None:
    """Exchange a link or token for a new session, which replaces the session of ``actor``.

    Returns None if the secret is not valid, or the token does not permit browser sign-in.
    """
    with service.store.reading() as session:
        if not credentials.can_sign_in(session, secret):
            return None  # Anybody can try: take the write lock only for a valid secret.
    with service.store.transaction() as session:
        new_session = credentials.redeem_link(session, secret) or credentials.start_session(session, secret)
        if new_session is not None and actor is not None:
            _end_session(session, actor)
    return new_session


def sign_out(service: Service, actor: Actor) -> None:
    """End the session that the actor is signed in with."""
    with service.store.transaction() as session:
        _end_session(session, actor)


def _end_session(session: Session, actor: Actor) -> None:
    assert actor.person_id is not None
    revocation.revoke_credential(session, actor.credential_id, actor.person_id)
