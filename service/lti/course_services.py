"""What an instructor asks of the platform that a course is launched from: its members enrolled, published marks sent.

How a platform is spoken to is ``services.py``'s.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.lti import services
from service.lti.passing_back import send_marks
from service.store import audit
from service.store.engine import Store
from service.store.people import lti
from service.store.people.lti import CourseLink
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class EnrolledMembers:
    """How many of a platform's members are in the course, and why others are not."""

    members: int
    refused: tuple[str, ...]


def enrol_members(store: Store, course_id: int, actor: str) -> EnrolledMembers:
    """Enrol everybody whom the platform has in the course.

    Raises UsageError where there is no platform, PlatformError where it gives no list.
    """
    link = _link(store, course_id)
    found = services.members(store, link)
    refused = []
    with store.transaction() as session:
        for each in found:
            try:
                with session.begin_nested():
                    lti.enrol(session, link.platform, course_id, each.subject, each.student, each.role)
            except UsageError as error:
                refused.append(str(error))
        enrolled = EnrolledMembers(len(found) - len(refused), tuple(refused))
        audit.note(session, actor, "enrol", "course", str(course_id), members=enrolled.members)
    return enrolled


def pass_back(store: Store, course_id: int, assignment: str, actor: str) -> int:
    """Send the published marks of an assignment to the platform's gradebook; how many there were.

    Raises UsageError where there is no platform, PlatformError where it takes none.
    """
    sent = send_marks(store, _link(store, course_id), course_id, assignment)
    with store.transaction() as session:
        audit.note(session, actor, "pass_back", "course", str(course_id), assignment=assignment, sent=sent)
    return sent


def _link(store: Store, course_id: int) -> CourseLink:
    with store.reading() as session:
        link = lti.course_link(session, course_id)
    if link is None:
        raise UsageError("this course is launched from no learning platform")
    return link
