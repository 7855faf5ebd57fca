"""LTI 1.3 launches: started by the platform, and completed with its signed identity token."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from service.lti import launch
from service.lti.keys import build_public_key_set, ensure_signing_key
from service.operations.context import Service
from service.operations.errors import Invalid
from service.store import audit
from service.store.people import credentials, lti, lti_launches
from service.store.people.credentials import SESSION_LIFETIME, NewSession
from service.store.people.lti import LaunchResult
from service.store.people.reach import Reach
from service.store.states import CredentialKind


@dataclass(frozen=True, slots=True)
class LaunchRequest:
    """The parameters with which a platform starts a launch."""

    issuer: str
    client_id: str  # empty if the platform does not send it
    login_hint: str
    message_hint: str
    address: str  # of this installation
    target: str  # the path to open after the launch


@dataclass(frozen=True, slots=True)
class StartedLaunch:
    """The state of a started launch, and the platform's address to redirect the browser to."""

    state: str
    authorization_address: str


@dataclass(frozen=True, slots=True)
class CompletedLaunch:
    """A session for the launched person, with the course, role and path to open."""

    session: NewSession
    launched: LaunchResult
    target: str


class UnknownPlatform(Invalid):
    """No registered platform has this issuer and client."""


def list_keys(service: Service) -> dict[str, Any]:
    """Return the JSON Web Key Set of this installation, creating a key if there is none."""
    with service.store.reading() as session:
        key_set = build_public_key_set(session)
    if key_set["keys"]:
        return key_set  # Anybody can request the keys: take the write lock only to create one.
    with service.store.transaction() as session:
        ensure_signing_key(session)
        return build_public_key_set(session)


def begin(service: Service, request: LaunchRequest) -> StartedLaunch:
    """Start a launch. Raises UnknownPlatform."""
    with service.store.reading() as session:
        platform = lti.find_platform(session, request.issuer, request.client_id or None)
    if platform is None:
        raise UnknownPlatform(
            "the platform %(issuer)s is not registered with this client ID", issuer=repr(request.issuer[:100])
        )
    with service.store.transaction() as session:
        state, nonce = lti_launches.begin_launch(session, platform, request.target)
    return_url = f"{request.address}/lti/launch"
    authorization_url = launch.build_authorization_url(
        platform, return_url, request.login_hint, request.message_hint, state, nonce
    )
    return StartedLaunch(state, authorization_url)


def complete(service: Service, state: str, id_token: str) -> CompletedLaunch:
    """Sign in the person identified by a platform, and enrol them in the launched course.

    Raises:
        Invalid: The launch has expired or was completed already, or no instructor has launched the course yet.
        UsageError: The token is not trusted, or the person's id belongs to another person.
        PlatformError: The platform's keys cannot be fetched.
    """
    with service.store.reading() as session:
        is_started = lti_launches.has_launch(session, state)
    pending_launch = None
    if is_started:  # Anybody can send a state: take the write lock only for a known one.
        with service.store.transaction() as session:
            pending_launch = lti_launches.take_launch(session, state)
    if pending_launch is None:
        raise Invalid("this launch has expired or was already used; open the link in the course again")
    claims = launch.read_launch(pending_launch, id_token)
    with service.store.transaction() as session:
        resolved_launch = lti.resolve_launch(
            session,
            pending_launch.platform,
            claims.deployment,
            claims.context,
            claims.course_title,
            claims.subject,
            claims.student,
            claims.role,
            claims.members_url,
            claims.lineitems_url,
        )
        if resolved_launch is None:
            raise Invalid(
                "no instructor has opened Robomark from this course yet; ask your instructor to open it first"
            )
        # A platform identifies people in its own courses only.
        kind, reach = CredentialKind.SESSION, Reach(platform_id=pending_launch.platform.id)
        secret = credentials.issue_credential(session, resolved_launch.person_id, kind, SESSION_LIFETIME, reach=reach)
        audit.record_action(
            session, f"platform {pending_launch.platform.name}", "launch", "person", str(resolved_launch.person_id)
        )
    return CompletedLaunch(NewSession(secret), resolved_launch, pending_launch.target)
