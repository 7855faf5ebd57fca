"""Labels in place of students' names, for assignments that are marked with names hidden.

A student has one label for each assignment, so that an assignment whose names are shown again tells nothing of others.
Which assignments are marked so is ``open_assignments.py``'s to say.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
from dataclasses import dataclass

from sqlalchemy.orm import Session

from service.store.courses.open_assignments import with_names_hidden
from service.store.engine import Store
from service.store.installation import secret_of
from submissions.seeds import Secret

_LONG = 6


@dataclass(frozen=True, slots=True)
class HiddenNames:
    """The assignments of a course whose students have labels in place of names."""

    assignments: frozenset[str]
    key: bytes

    def called(self, assignment: str, student: str) -> str:
        """Return the label of the student with this id; the id itself where names are not hidden."""
        if assignment not in self.assignments:
            return student
        whose = f"{assignment}\n{student}".encode("utf-8", "surrogatepass")
        digest = hmac.new(self.key, whose, hashlib.sha256).digest()
        return f"Participant {base64.b32encode(digest)[:_LONG].decode('ascii')}"


#: For operators and their commands, which show every name.
NAMED = HiddenNames(frozenset(), b"")


def hidden_names_of(store: Store, course_id: int) -> HiddenNames:
    """Those of a course, by the installation's own secret."""
    secret = secret_of(store)
    with store.reading() as session:
        return hidden_names(session, course_id, secret)


def hidden_names(session: Session, course_id: int, secret: Secret) -> HiddenNames:
    """Those of a course; numbers follow from the installation's secret, so that nobody can count them out."""
    key = hmac.new(secret.text.encode("utf-8", "surrogateescape"), f"names {course_id}".encode(), hashlib.sha256)
    return HiddenNames(with_names_hidden(session, course_id), key.digest())
