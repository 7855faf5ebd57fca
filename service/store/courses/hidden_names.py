"""Whose work it is, where whoever marks is not to know: what each student is called instead, the same everywhere.

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
    """The assignments of a course whose students are called by a number of their own."""

    assignments: frozenset[str]
    key: bytes

    def called(self, assignment: str, student: str) -> str:
        """What the student with this id is called; their id where names are not hidden."""
        if assignment not in self.assignments:
            return student
        digest = hmac.new(self.key, student.encode("utf-8", "surrogatepass"), hashlib.sha256).digest()
        return f"Participant {base64.b32encode(digest)[:_LONG].decode('ascii')}"


def hidden_names_of(store: Store, course_id: int) -> HiddenNames:
    """Those of a course, by the installation's own secret."""
    secret = secret_of(store)
    with store.reading() as session:
        return hidden_names(session, course_id, secret)


def hidden_names(session: Session, course_id: int, secret: Secret) -> HiddenNames:
    """Those of a course; numbers follow from the installation's secret, so that nobody can count them out."""
    key = hmac.new(secret.text.encode("utf-8", "surrogateescape"), f"names {course_id}".encode(), hashlib.sha256)
    return HiddenNames(with_names_hidden(session, course_id), key.digest())
