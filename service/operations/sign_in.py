"""Signing in and out, and who has the secret of a session or a token.

What somebody does with their own sessions and tokens is in ``credentials.py``.
"""

from __future__ import annotations

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.store.people import credentials
from service.store.people.credentials import Identity as Identity
from service.store.people.credentials import LinkOwner
from service.store.people.credentials import NewSession as NewSession
from service.store.states import CredentialKind


def identify(service: Service, secret: str, kind: CredentialKind) -> Identity | None:
    """The owner of a session or a token, with the roles that it reaches. None if it is not valid."""
    with service.store.reading() as session:
        return credentials.identify(session, secret, kind)


def note_use(service: Service, identity: Identity) -> None:
    """Record that a token is used."""
    with service.store.transaction() as session:
        credentials.note_use(session, identity.credential_id)


def show_link(service: Service, link: str) -> LinkOwner | None:
    """The person whom a link would sign in. None if the link is not valid."""
    with service.store.reading() as session:
        return credentials.owner(session, link)


def sign_in(service: Service, actor: Actor | None, secret: str) -> NewSession | None:
    """Exchange a link or a token for a new session, which ends the one of an ``actor`` who was signed in.

    None if the secret is not valid, or is that of a token that signs no browser in.
    """
    with service.store.transaction() as session:
        started = credentials.redeem(session, secret) or credentials.start_session(session, secret)
        if started is not None and actor is not None:
            _end_session(session, actor)
    return started


def sign_out(service: Service, actor: Actor) -> None:
    """End the session that the actor signed in with."""
    with service.store.transaction() as session:
        _end_session(session, actor)


def _end_session(session: Session, actor: Actor) -> None:
    assert actor.person_id is not None
    credentials.revoke(session, actor.credential_id, actor.person_id)
