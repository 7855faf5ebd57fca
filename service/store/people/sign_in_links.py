"""Links that sign people in once: a person's newest alone counts, and who made it is written down.

What a link is exchanged for is ``credentials.py``'s.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from service.store import audit
from service.store.engine import now
from service.store.models import Enrolment
from service.store.people import credentials, people
from service.store.people.credentials import LINK_LIFETIME
from service.store.people.people import Member
from sim.errors import UsageError

#: What links for a whole course may be made to last, which are handed on by other means.
DAYS, MOST_DAYS = 7, 30
_ELSEWHERE = "is in other courses, too, and signs in by whoever runs Robomark"


@dataclass(frozen=True, slots=True)
class StudentLink:
    """One student's, or why there is none."""

    student: Member
    secret: str | None
    expires_at: datetime | None
    reason: str


def make_link(session: Session, person_id: int, actor: str, *, word: str = "") -> str:
    """The secret of a person's new link; ``word`` is as ``replace_links`` has it."""
    (secret,) = credentials.replace_links(session, [person_id], LINK_LIFETIME, word).values()
    audit.note(session, actor, "link", "person", str(person_id))
    return secret


def make_students_link(session: Session, row: Enrolment, actor: str, *, word: str = "") -> str:
    """The same for a student of a course, by whoever instructs it.

    Raises UsageError where the student is more than that, for the link would sign them in as all that they are.
    """
    if people.is_more_than(session, row):
        raise UsageError(f"this person {_ELSEWHERE}")
    return make_link(session, row.person_id, actor, word=word)


def make_links(session: Session, course_id: int, lifetime: timedelta, actor: str) -> list[StudentLink]:
    """One for each student of the course, by id."""
    listed = people.students(session, course_id)
    made = credentials.replace_links(session, [each.person_id for each, more in listed if not more], lifetime)
    until = now(session) + lifetime
    audit.note(session, actor, "links", "course", str(course_id), students=len(made), days=lifetime.days)
    return [
        StudentLink(each, None, None, _ELSEWHERE) if more else StudentLink(each, made[each.person_id], until, "")
        for each, more in listed
    ]
