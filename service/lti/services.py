"""Services of a platform: members (Names and Role Provisioning 2.0) and marks (Assignment and Grade 2.0).

The caller selects the marks to send.
"""

from __future__ import annotations

import json
import re
import time
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from typing import Any
from urllib.parse import urlencode

import jwt

from service.lti.keys import ensure_signing_key
from service.lti.launch import build_student, parse_role, read_objects, read_string
from service.lti.platform_requests import PlatformError, PlatformReply, fetch_json
from service.store.engine import Store
from service.store.people.lti import CourseLink, Platform, parse_origin
from service.store.states import Role
from submissions.student_identity import Student

_MEMBERS_SCOPE = "https://purl.imsglobal.org/spec/lti-nrps/scope/contextmembership.readonly"
_GRADES_SCOPES = (
    "https://purl.imsglobal.org/spec/lti-ags/scope/lineitem https://purl.imsglobal.org/spec/lti-ags/scope/score"
)
_MEMBERS = "application/vnd.ims.lti-nrps.v2.membershipcontainer+json"
_LINEITEM = "application/vnd.ims.lis.v2.lineitem+json"
_LINEITEMS = "application/vnd.ims.lis.v2.lineitemcontainer+json"
_SCORE = "application/vnd.ims.lis.v1.score+json"
# Without "<" in the address, a search takes time linear in the length of the header.
_NEXT_LINK = re.compile(r'<([^<>]+)>\s*;\s*rel="?next"?')
_MAX_PAGES = 200
_ASSERTION_SECONDS = 60


@dataclass(frozen=True, slots=True)
class PlatformMember:
    """A member of a course on a platform."""

    subject: str
    student: Student
    role: Role


@dataclass(frozen=True, slots=True)
class Score:
    """Marks of one student for one assignment."""

    subject: str
    marks: Decimal
    max_marks: Decimal
    at: datetime


def fetch_members(store: Store, link: CourseLink) -> list[PlatformMember]:
    """Return the active members of the course. Raises PlatformError if the platform returns no list."""
    if link.members_url is None:
        raise PlatformError("The platform did not send the address of its member list")
    _check_origin(link.platform, link.members_url)
    headers = {"accept": _MEMBERS, "authorization": f"Bearer {_request_token(store, link.platform, _MEMBERS_SCOPE)}"}
    members = []
    for page in _fetch_pages(link.platform, link.members_url, headers):
        for member in read_objects(page.get("members") if isinstance(page, dict) else None):
            subject = read_string(member, "user_id")
            if subject is None or member.get("status", "Active") != "Active":
                continue
            parts = (read_string(member, "given_name"), read_string(member, "family_name"))
            name = read_string(member, "name") or " ".join(filter(None, parts))
            student_id, email = read_string(member, "lis_person_sourcedid"), read_string(member, "email")
            student = build_student(link.platform, subject, student_id, name, email)
            members.append(PlatformMember(subject, student, parse_role(_expand_roles(member.get("roles")))))
    return members


def send_scores(store: Store, link: CourseLink, assignment: str, title: str, scores: list[Score]) -> int:
    """Send marks to the platform's column for the assignment, creating it if necessary. Returns their number.

    Raises PlatformError if the platform does not accept them.
    """
    if link.lineitems_url is None:
        raise PlatformError("The platform did not send the address for marks")
    _check_origin(link.platform, link.lineitems_url)
    if not scores:
        return 0
    token = _request_token(store, link.platform, _GRADES_SCOPES)
    column = _ensure_column(
        link.platform, link.lineitems_url, token, assignment, title, max(each.max_marks for each in scores)
    )
    path, _, query = column.partition("?")
    scores_url = f"{path.rstrip('/')}/scores" + (f"?{query}" if query else "")
    for score in scores:
        body = {
            "userId": score.subject,
            "scoreGiven": float(score.marks),
            "scoreMaximum": float(score.max_marks),
            "comment": "",
            "timestamp": score.at.isoformat(timespec="milliseconds"),
            "activityProgress": "Completed",
            "gradingProgress": "FullyGraded",
        }
        headers = {"content-type": _SCORE, "authorization": f"Bearer {token}"}
        _send_request(link.platform, scores_url, method="POST", body=json.dumps(body).encode(), headers=headers)
    return len(scores)


def _ensure_column(
    platform: Platform, lineitems_url: str, token: str, assignment: str, title: str, max_marks: Decimal
) -> str:
    headers = {"accept": _LINEITEMS, "authorization": f"Bearer {token}"}
    separator = "&" if "?" in lineitems_url else "?"
    for page in _fetch_pages(platform, f"{lineitems_url}{separator}{urlencode({'resource_id': assignment})}", headers):
        for item in read_objects(page):
            if item.get("resourceId") == assignment and isinstance(item.get("id"), str):
                return str(item["id"])
    description = {"label": title, "scoreMaximum": float(max_marks), "resourceId": assignment, "tag": "robomark"}
    column = _send_request(
        platform,
        lineitems_url,
        method="POST",
        body=json.dumps(description).encode(),
        headers={"content-type": _LINEITEM, "accept": _LINEITEM, "authorization": f"Bearer {token}"},
    ).value
    if not isinstance(column, dict) or not isinstance(column.get("id"), str):
        raise PlatformError("The platform did not create a column for the marks")
    return str(column["id"])


def _request_token(store: Store, platform: Platform, scopes: str) -> str:
    """Request an access token with a signed assertion (RFC 7523)."""
    with store.transaction() as session:
        key_id, pem = ensure_signing_key(session)
    issued_at = int(time.time())
    claims = {
        "iss": platform.client_id,
        "sub": platform.client_id,
        "aud": platform.token_url,
        "iat": issued_at,
        "exp": issued_at + _ASSERTION_SECONDS,
        "jti": str(uuid.uuid4()),
    }
    parameters = {
        "grant_type": "client_credentials",
        "client_assertion_type": "urn:ietf:params:oauth:client-assertion-type:jwt-bearer",
        "client_assertion": jwt.encode(claims, pem, algorithm="RS256", headers={"kid": key_id}),
        "scope": scopes,
    }
    headers = {"content-type": "application/x-www-form-urlencoded"}
    answer = fetch_json(platform.token_url, method="POST", body=urlencode(parameters).encode(), headers=headers).value
    token = answer.get("access_token") if isinstance(answer, dict) else None
    if not isinstance(token, str):
        raise PlatformError("The platform did not return an access token")
    return token


def _send_request(platform: Platform, url: str, **request: Any) -> PlatformReply:
    """Call an address from a launch or the platform if its origin is registered. Raises PlatformError."""
    _check_origin(platform, url)
    return fetch_json(url, **request)


def _check_origin(platform: Platform, url: str) -> None:
    if not platform.has_registered_origin(url):
        raise PlatformError(
            f"The platform uses {parse_origin(url) or 'an invalid address'} for a service, which is not "
            "registered for it; ask an operator of Robomark to add this address to the platform's services"
        )


def _fetch_pages(platform: Platform, url: str, headers: Mapping[str, str]) -> Iterator[Any]:
    for _ in range(_MAX_PAGES):
        reply = _send_request(platform, url, headers=headers)
        yield reply.value
        next_link = _NEXT_LINK.search(reply.link)
        if next_link is None:
            return
        url = next_link[1]


def _expand_roles(roles: object) -> list[str]:
    """Return roles with their full names: short names are allowed in member lists."""
    role_names = roles if isinstance(roles, list) else []
    prefix = "http://purl.imsglobal.org/vocab/lis/v2/membership#"
    return [role if "/" in role else f"{prefix}{role}" for role in role_names if isinstance(role, str)]
