"""Reach of a credential: the courses, role, platform and scopes that it is limited to, and the queries for it.

``credentials.py`` issues and revokes credentials.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, select

from service.store.states import Role
from service.store.tables.people import Credential, Enrolment, LtiCourse


@dataclass(frozen=True, slots=True)
class Reach:
    """Limits of a credential: never beyond the course, role, platform and scopes of its issuer."""

    course_id: int | None = None
    role: Role | None = None
    platform_id: int | None = None
    scopes: frozenset[str] = frozenset()  # empty: all scopes for a session, none for a token

    @property
    def is_unlimited(self) -> bool:
        """Return whether it reaches every course of its owner in every role."""
        return self.course_id is None and self.role is None and self.platform_id is None


UNLIMITED_REACH = Reach()


def build_reach(row: Credential) -> Reach:
    """Return the reach of a stored credential."""
    return Reach(row.course_id, row.role, row.platform_id, frozenset(row.scopes))


def build_reach_columns(reach: Reach) -> dict[str, Any]:
    """Return the columns that store a reach."""
    return {
        "course_id": reach.course_id,
        "role": reach.role,
        "platform_id": reach.platform_id,
        "scopes": sorted(reach.scopes),
    }


def match_reached_enrolments(reach: Reach) -> list[ColumnElement[bool]]:
    """Return the conditions for the enrolments within a credential's reach."""
    conditions: list[ColumnElement[bool]] = []
    if reach.course_id is not None:
        conditions.append(Enrolment.course_id == reach.course_id)
    if reach.role is not None:
        conditions.append(Enrolment.role == reach.role)
    if reach.platform_id is not None:
        launched_courses = select(LtiCourse.course_id).where(LtiCourse.platform_id == reach.platform_id)
        conditions.append(Enrolment.course_id.in_(launched_courses))
    return conditions


def match_reached_credentials(reach: Reach) -> list[ColumnElement[bool]]:
    """Return the conditions for credentials within this reach: only these may be viewed and revoked with it."""
    limits = (
        (Credential.course_id, reach.course_id),
        (Credential.role, reach.role),
        (Credential.platform_id, reach.platform_id),
    )
    return [column == limit for column, limit in limits if limit is not None]
