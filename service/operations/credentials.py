"""Sessions and tokens of the actor, within the reach of their credential: create, list and end them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import timedelta

from sqlalchemy.orm import Session

from service.operations.context import Actor, Service
from service.operations.errors import Conflict, Forbidden, Invalid, NotFound
from service.operations.scopes import list_offered_scopes
from service.store import audit
from service.store.people import credentials, revocation
from service.store.people.credentials import MAX_TOKENS, CredentialLine
from service.store.people.reach import Reach
from service.store.states import Role


@dataclass(frozen=True, slots=True)
class TokenRequest:
    """A token to create. ``word`` determines its secret, so that repeating the request creates no second token."""

    name: str
    scopes: frozenset[str]
    days: int
    word: str


def make_token(service: Service, actor: Actor, request: TokenRequest) -> None:
    """Create a token for the actor, with at most the reach of their credential.

    Raises Invalid for scopes that the actor cannot use, Conflict if they have too many tokens.
    """
    person_id = _require_person_id(actor)
    check_scopes(request.scopes, list(actor.roles.values()), operator=actor.operator, limit=actor.reach.scopes)
    reach = replace(actor.reach, scopes=request.scopes)
    with service.store.transaction() as session:
        if not credentials.find_unused_token(session, person_id, request.word):
            check_token_count(session, person_id)
        lifetime = timedelta(days=request.days)
        credentials.create_token(
            session,
            person_id,
            lifetime,
            request.word,
            name=request.name,
            reach=reach,
            parent_token_id=actor.credential_id,
        )
        audit.record_action(session, actor.name, "token", "person", str(person_id), scopes=sorted(request.scopes))


def show_unused_token(service: Service, actor: Actor, word: str) -> str:
    """Return the secret of the actor's token created from this word; empty after its first use."""
    with service.store.reading() as session:
        return credentials.find_unused_token(session, _require_person_id(actor), word)


def list_credentials(service: Service, actor: Actor) -> list[CredentialLine]:
    """Return the actor's sessions and tokens, newest first."""
    with service.store.reading() as session:
        return credentials.list_credentials(session, _require_person_id(actor), actor.reach)


def end_credential(service: Service, actor: Actor, credential_id: str) -> None:
    """End one of the actor's sessions or tokens. Raises NotFound if they do not have it."""
    person_id = _require_person_id(actor)
    with service.store.transaction() as session:
        if not revocation.revoke_credential(session, credential_id, person_id, actor.reach):
            raise NotFound("you have no session or token with this id")
        audit.record_action(session, actor.name, "sign out", "person", str(person_id), ended=1)


def end_other_credentials(service: Service, actor: Actor) -> int:
    """End all credentials of the actor except the one in use. Returns the number ended."""
    person_id = _require_person_id(actor)
    with service.store.transaction() as session:
        ended_count = revocation.revoke_all(session, person_id, kept_id=actor.credential_id, reach=actor.reach)
        audit.record_action(session, actor.name, "sign out", "person", str(person_id), ended=ended_count)
    return ended_count


def check_scopes(
    scopes: frozenset[str], roles: list[Role], *, operator: bool, limit: frozenset[str] = Reach().scopes
) -> None:
    """Raise Invalid unless a person with these roles can use the scopes. An empty ``limit`` means no limit."""
    offered_scopes = list_offered_scopes(roles, operator=operator, limit=limit or None)
    if not scopes or not scopes <= offered_scopes.keys():
        raise Invalid("Select at least one of these scopes: %(scopes)s.", scopes=", ".join(offered_scopes))


def check_token_count(session: Session, person_id: int) -> None:
    """Raise Conflict if a person has the maximum number of tokens."""
    if credentials.count_tokens(session, person_id) >= MAX_TOKENS:
        raise Conflict("The limit of %(count)s tokens is reached. Revoke a token first.", count=MAX_TOKENS)


def _require_person_id(actor: Actor) -> int:
    if actor.person_id is None:
        raise Forbidden("sign in to see your sessions and tokens")
    return actor.person_id
