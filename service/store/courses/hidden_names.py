"""Labels that replace students' names in assignments with anonymous marking.

A student has a different label in each assignment, so showing the names of one reveals nothing about others.
``open_assignments.py`` stores which assignments are marked anonymously.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
from dataclasses import dataclass
from functools import lru_cache

from sqlalchemy import exists, literal, select, union_all

from service.store.courses.open_assignments import match_anonymous_assignments
from service.store.engine import Store
from service.store.installation import require_secret
from service.store.tables.courses import OpenAssignment
from service.store.tables.installation import Installation
from service.store.tables.people import Enrolment

_LABEL_LENGTH = 6
#: Letters of five bits, so that not even 100,000 participants have the same label by chance.
_LONG_LABEL_LENGTH = 12


@dataclass(frozen=True, slots=True)
class HiddenNames:
    """Assignments of a course that show labels instead of names.

    ``students`` are the ids in the course, in the order of their enrolment.
    """

    assignments: frozenset[str]
    key: bytes
    students: tuple[str, ...] = ()

    def label_student(self, assignment: str, student: str) -> str:
        """Return the label of the student with this id; the id itself if names are not hidden.

        The label has more letters if a student who enrolled earlier has the same ones. So it never changes when
        other students enrol.
        """
        if assignment not in self.assignments:
            return student
        is_taken = student in _find_later_namesakes(self.key, assignment, self.students)
        length = _LONG_LABEL_LENGTH if is_taken else _LABEL_LENGTH
        return f"Participant {_compute_letters(self.key, assignment, student)[:length]}"


@lru_cache(maxsize=64)
def _find_later_namesakes(key: bytes, assignment: str, students: tuple[str, ...]) -> frozenset[str]:
    """Return the students whose short label is that of an earlier student."""
    labels: set[str] = set()
    namesakes = set()
    for student in students:
        label = _compute_letters(key, assignment, student)[:_LABEL_LENGTH]
        if label in labels:
            namesakes.add(student)
        labels.add(label)
    return frozenset(namesakes)


def _compute_letters(key: bytes, assignment: str, student: str) -> str:
    message = f"{assignment}\n{student}".encode("utf-8", "surrogatepass")
    return base64.b32encode(hmac.digest(key, message, "sha256")).decode("ascii")


#: For operators and their commands, which show every name.
NO_HIDDEN_NAMES = HiddenNames(frozenset(), b"")


def load_hidden_names(store: Store, course_id: int) -> HiddenNames:
    """Return the hidden names of a course. Labels are keyed by the installation's secret, so they cannot be guessed."""
    own_secret = select(Installation.secret).scalar_subquery()
    is_hidden = match_anonymous_assignments(course_id)
    # One statement, because every page about such a course needs it: assignments have the number 0.
    students_of_course = select(Enrolment.student, Enrolment.id, own_secret)
    query = union_all(
        select(OpenAssignment.assignment, literal(0).label("number"), own_secret).where(*is_hidden),
        students_of_course.where(Enrolment.course_id == course_id, exists().where(*is_hidden)),
    ).order_by("number")
    with store.reading() as session:
        rows = session.execute(query).all()
    if not rows:
        return NO_HIDDEN_NAMES
    secret = store.secret or require_secret(rows[0][2])
    key = hmac.new(secret.text.encode("utf-8", "surrogateescape"), f"names {course_id}".encode(), hashlib.sha256)
    assignments = frozenset(text for text, number, _ in rows if not number)
    return HiddenNames(assignments, key.digest(), tuple(text for text, number, _ in rows if number))
