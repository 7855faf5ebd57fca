"""LTI 1.3 launches: the login started by a platform, and the identity token that completes it.

Follows the 1EdTech Security Framework 1.0, section 5.1, and LTI core 1.3, section 5. Does not sign anyone in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

import jwt
from jwt import PyJWK, PyJWKSet
from jwt.exceptions import InvalidAlgorithmError, PyJWTError

from service.lti.platform_requests import fetch_json
from service.store.people.lti import Platform
from service.store.people.lti_launches import PendingLaunch
from service.store.states import Role
from sim.errors import UsageError
from submissions.student_identity import Student

CLAIM = "https://purl.imsglobal.org/spec/lti/claim/"
MEMBERS_CLAIM = "https://purl.imsglobal.org/spec/lti-nrps/claim/namesroleservice"
GRADES_CLAIM = "https://purl.imsglobal.org/spec/lti-ags/claim/endpoint"
_MEMBERSHIP_ROLES = "http://purl.imsglobal.org/vocab/lis/v2/membership"
_CLOCK_LEEWAY_SECONDS = 60
_ALGORITHM = "RS256"
_MAX_TEXT_LENGTH = 250


@dataclass(frozen=True, slots=True)
class Launch:
    """The claims of a platform: the person, their role and the course."""

    subject: str
    student: Student
    role: Role
    deployment: str
    context: str
    course_title: str
    members_url: str | None
    lineitems_url: str | None


def build_authorization_url(
    platform: Platform, redirect_uri: str, login_hint: str, message_hint: str | None, state: str, nonce: str
) -> str:
    """Return the platform's address that authenticates the user."""
    parameters = {
        "scope": "openid",
        "response_type": "id_token",
        "response_mode": "form_post",
        "prompt": "none",
        "client_id": platform.client_id,
        "redirect_uri": redirect_uri,
        "login_hint": login_hint,
        "state": state,
        "nonce": nonce,
    }
    if message_hint:
        parameters["lti_message_hint"] = message_hint
    separator = "&" if "?" in platform.authorization_url else "?"
    return f"{platform.authorization_url}{separator}{urlencode(parameters)}"


def read_launch(pending: PendingLaunch, id_token: str) -> Launch:
    """Verify the audience, time, nonce and signature of an identity token and return its launch.

    The signature is checked last: only a token that passes all other checks causes a request for the platform's keys.

    Raises UsageError if the token is not trusted, PlatformError if the platform's keys cannot be fetched.
    """
    launch = _build_launch(pending.platform, _read_claims(pending, id_token))
    _verify_signature(pending.platform, id_token)
    return launch


def _build_launch(platform: Platform, claims: Mapping[str, Any]) -> Launch:
    """Return the launch with these claims. Raises UsageError if one is missing or not supported."""
    if claims.get(f"{CLAIM}version") != "1.3.0":
        raise UsageError("this launch does not use LTI 1.3")
    if claims.get(f"{CLAIM}message_type") != "LtiResourceLinkRequest":
        raise UsageError("this launch does not come from a link in a course; open Robomark from a course link")
    deployment_id = claims.get(f"{CLAIM}deployment_id")
    if not isinstance(deployment_id, str) or deployment_id not in platform.deployments:
        raise UsageError(f"the deployment of this launch is not registered: {str(deployment_id)[:80]!r}")
    context = _read_object(claims, f"{CLAIM}context")
    context_id = context.get("id")
    subject = claims.get("sub")
    if not isinstance(context_id, str) or not isinstance(subject, str) or not context_id or not subject:
        raise UsageError("this launch has no course or no user; the platform must send both")
    title = context.get("title") or context.get("label") or context_id
    return Launch(
        subject=subject,
        student=_parse_student(claims, platform, subject),
        role=parse_role(claims.get(f"{CLAIM}roles")),
        deployment=deployment_id,
        context=context_id,
        course_title=str(title)[:_MAX_TEXT_LENGTH],
        members_url=read_string(_read_object(claims, MEMBERS_CLAIM), "context_memberships_url"),
        lineitems_url=read_string(_read_object(claims, GRADES_CLAIM), "lineitems"),
    )


def parse_role(roles: object) -> Role:
    """Return instructor for an instructor of the course, otherwise student. Roles in the institution do not count."""
    role_names = {role for role in roles if isinstance(role, str)} if isinstance(roles, list) else set()
    return Role.INSTRUCTOR if role_names & {f"{_MEMBERSHIP_ROLES}#Instructor", "Instructor"} else Role.STUDENT


def build_student(platform: Platform, subject: str, id: str | None, name: str | None, email: str | None) -> Student:
    """Convert a person of a platform to a student, with the institution's id if the platform sends one.

    Only names and e-mail addresses are truncated, because truncated ids could collide.
    """
    return Student(
        id or f"{platform.name} {subject}", (name or "")[:_MAX_TEXT_LENGTH], (email or "")[:_MAX_TEXT_LENGTH]
    )


def _read_claims(pending: PendingLaunch, id_token: str) -> dict[str, Any]:
    """Return the claims of a token after the checks that need no request. Its signature is not verified."""
    client_id = pending.platform.client_id
    claims = _decode_token(pending.platform, id_token)
    audience = claims["aud"]
    party = claims.get("azp")  # who may present the token; required if it is for several
    has_other_audiences = isinstance(audience, list) and len(audience) > 1
    if party != client_id and (party is not None or has_other_audiences):
        raise UsageError("the platform's token is for another tool")
    if claims["nonce"] != pending.nonce:
        raise UsageError("this launch was already used or started elsewhere; open the link in the course again")
    return claims


def _verify_signature(platform: Platform, id_token: str) -> None:
    keys = fetch_json(platform.keys_url).value
    try:
        key = PyJWKSet.from_dict(keys)[jwt.get_unverified_header(id_token).get("kid", "")]
    except (PyJWTError, KeyError, TypeError, AttributeError) as error:
        raise _build_token_error(error) from None
    _decode_token(platform, id_token, key)


def _decode_token(platform: Platform, id_token: str, key: PyJWK | None = None) -> dict[str, Any]:
    """Return the claims of a token for this tool that has not expired. Its signature is verified if there is a key."""
    try:
        if jwt.get_unverified_header(id_token).get("alg") != _ALGORITHM:
            raise InvalidAlgorithmError(f"its algorithm is not {_ALGORITHM}")
        claims: dict[str, Any] = jwt.decode(
            id_token,
            "" if key is None else key,
            algorithms=[_ALGORITHM],
            audience=platform.client_id,
            issuer=platform.issuer,
            leeway=_CLOCK_LEEWAY_SECONDS,
            # Without the signature, PyJWT checks only what it is asked to check.
            options={
                "verify_signature": key is not None,
                "verify_exp": True,
                "verify_nbf": True,
                "verify_iat": True,
                "verify_aud": True,
                "verify_iss": True,
                "verify_sub": True,
                "require": ["exp", "iat", "aud", "iss", "sub", "nonce"],
            },
        )
    except (PyJWTError, KeyError, TypeError, AttributeError) as error:
        raise _build_token_error(error) from None
    return claims


def _build_token_error(error: Exception) -> UsageError:
    return UsageError(f"the platform's token is invalid: {error}")


def _parse_student(claims: Mapping[str, Any], platform: Platform, subject: str) -> Student:
    student_id = read_string(_read_object(claims, f"{CLAIM}lis"), "person_sourcedid")
    return build_student(platform, subject, student_id, read_string(claims, "name"), read_string(claims, "email"))


def _read_object(claims: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    value = claims.get(name)
    return value if isinstance(value, dict) else {}


def read_string(table: Mapping[str, Any], name: str) -> str | None:
    """Return a string value sent by a platform; None if it is missing or not a string."""
    value = table.get(name)
    return value if isinstance(value, str) and value else None


def read_objects(value: object) -> list[Mapping[str, Any]]:
    """Return the objects in a list sent by a platform, skipping other values."""
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []
