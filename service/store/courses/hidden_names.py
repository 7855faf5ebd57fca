"""Labels that replace students' names in assignments with anonymous marking.

A student has a different label in each assignment, so showing the names of one reveals nothing about others.
``open_assignments.py`` stores which assignments are marked anonymously.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
from dataclasses import dataclass

from sqlalchemy import select

from service.store.courses.open_assignments import match_anonymous_assignments
from service.store.engine import Store
from service.store.installation import require_secret
from service.store.tables.courses import OpenAssignment
from service.store.tables.installation import Installation

_LABEL_LENGTH = 6


@dataclass(frozen=True, slots=True)
class HiddenNames:
    """Assignments of a course that show labels instead of names."""

    assignments: frozenset[str]
    key: bytes

    def label_student(self, assignment: str, student: str) -> str:
        """Return the label of the student with this id; the id itself if names are not hidden."""
        if assignment not in self.assignments:
            return student
        message = f"{assignment}\n{student}".encode("utf-8", "surrogatepass")
        digest = hmac.new(self.key, message, hashlib.sha256).digest()
        return f"Participant {base64.b32encode(digest)[:_LABEL_LENGTH].decode('ascii')}"


#: For operators and their commands, which show every name.
NO_HIDDEN_NAMES = HiddenNames(frozenset(), b"")


def load_hidden_names(store: Store, course_id: int) -> HiddenNames:
    """Return the hidden names of a course. Labels are keyed by the installation's secret, so they cannot be guessed."""
    own_secret = select(Installation.secret).scalar_subquery()
    with store.reading() as session:
        rows = session.execute(
            select(OpenAssignment.assignment, own_secret).where(*match_anonymous_assignments(course_id))
        ).all()
    if not rows:
        return NO_HIDDEN_NAMES
    secret = store.secret or require_secret(rows[0][1])
    key = hmac.new(secret.text.encode("utf-8", "surrogateescape"), f"names {course_id}".encode(), hashlib.sha256)
    return HiddenNames(frozenset(assignment for assignment, _ in rows), key.digest())
