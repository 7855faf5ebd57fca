"""Students of a course: lookup by id, enrolment of new students, rejection of ambiguous ids.

``submissions.student_names`` defines the normal form of names; ``intake.py`` stores submissions.
"""

from __future__ import annotations

import unicodedata
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.conditional_insert import insert_if_new
from service.store.states import Role
from service.store.tables.courses import Course
from service.store.tables.people import Enrolment, Person
from sim.errors import UsageError
from submissions.raw_files import sanitise_name
from submissions.student_identity import Student
from submissions.student_names import compute_name_forms, describe_look_alikes, normalise_name
from submissions.suggestions import suggest_name

#: The course of an installation with a single course.
DEFAULT_COURSE = "default"


def ensure_course(session: Session, name: str, current_time: datetime) -> int:
    """Return the id of a course, creating it if necessary, and lock it: numbering attempts needs a single writer."""
    insert_if_new(session, Course, name=name, created_at=current_time)
    return session.scalars(select(Course.id).where(Course.name == name).with_for_update(key_share=True)).one()


class Students:
    """The students of one course, within a transaction that has locked it."""

    def __init__(self, session: Session, course_id: int) -> None:
        self._session = session
        self._course_id = course_id
        self._by_form: dict[str, dict[str, int]] | None = None

    def enrol(self, student: Student, current_time: datetime) -> int:
        """Return the enrolment of the student with this id, creating it if necessary.

        An id that is not in normal form matches only the spelling that was enrolled first. Name and e-mail address are
        updated. Raises UsageError for an empty id, or one that is ambiguous.
        """
        normal_id, written_id = normalise_name(student.id), unicodedata.normalize("NFC", student.id)
        if not normal_id:
            raise UsageError("the name of the student is empty, expected visible characters.")
        enrolment = self._find_row(normal_id)
        if enrolment is None:
            confusable_rows = self._find_confusable(normal_id)
            # Enrolments from before normal forms may have surrounding blanks.
            matching_ids = [
                enrolment_id for other, enrolment_id in confusable_rows.items() if normalise_name(other) == normal_id
            ]
            if len(matching_ids) == 1:
                self._update_contact(matching_ids[0], student)
                return matching_ids[0]
            if not confusable_rows:
                return self._create_enrolment(normal_id, written_id, student, current_time)
        else:
            confusable_rows = {normal_id: enrolment.id}
            if written_id == normal_id:
                enrolment.written = normal_id
            if written_id == enrolment.written:
                self._update_contact(enrolment.id, student)
                return enrolment.id
        raise UsageError(
            f'"{sanitise_name(written_id)}" {describe_look_alikes(list(confusable_rows)[:3])}, who is in this course; '
            "expected that name as it is written there, or another."
        )

    def is_enrolled(self, enrolment_id: int, student: Student) -> bool:
        """Return whether an enrolment still belongs to this student: SQLite reuses the ids of deleted rows."""
        row = self._session.get(Enrolment, enrolment_id)
        if row is None or row.course_id != self._course_id:
            return False
        return normalise_name(row.written) == normalise_name(student.id)

    def find_enrolment(self, student: Student) -> int | None:
        """Return the enrolment of the student with this normal form; None if there is none, or it is ambiguous."""
        enrolment = self._find_row(normalise_name(student.id))
        return None if enrolment is None else enrolment.id

    def load_enrolment(self, written_id: str) -> int:
        """Return the enrolment of the student with this id.

        Raises UsageError, with a similar id if there is one, for a student who is not in the course.
        """
        enrolment = self._find_row(normalise_name(written_id))
        if enrolment is not None:
            return enrolment.id
        known_students = self._session.scalars(select(Enrolment.student).where(Enrolment.course_id == self._course_id))
        hint = (
            suggest_name(written_id, known_students)
            or "; to enrol a student without submissions, use robomark course enrol"
        )
        raise UsageError(f"there is no student {sanitise_name(written_id)!r} in this course{hint}")

    def _find_row(self, normal_id: str) -> Enrolment | None:
        query = select(Enrolment).where(Enrolment.course_id == self._course_id, Enrolment.student == normal_id)
        return self._session.scalars(query).one_or_none()

    def _update_contact(self, enrolment_id: int, student: Student) -> None:
        row = self._session.get_one(Enrolment, enrolment_id)
        # A table uploaded by one instructor does not rename another instructor.
        if row.role is Role.STUDENT:
            row.name, row.email = student.name or row.name, student.email or row.email

    def _create_enrolment(self, normal_id: str, written_id: str, student: Student, current_time: datetime) -> int:
        person = Person(created_at=current_time)
        self._session.add(person)
        self._session.flush()
        row = Enrolment(
            course_id=self._course_id,
            person_id=person.id,
            student=normal_id,
            written=written_id,
            role=Role.STUDENT,
            name=student.name,
            email=student.email,
        )
        self._session.add(row)
        self._session.flush()
        self._index_name(normal_id, row.id)
        return row.id

    def _find_confusable(self, name: str) -> dict[str, int]:
        """Return the students that could be confused with this name, as a mapping of names to enrolments."""
        if self._by_form is None:
            self._by_form = {}
            query = select(Enrolment.student, Enrolment.id).where(Enrolment.course_id == self._course_id)
            for student, enrolment_id in self._session.execute(query):
                self._index_name(student, enrolment_id)
        return {
            other: which
            for form in sorted(compute_name_forms(name))
            for other, which in self._by_form.get(form, {}).items()
        }

    def _index_name(self, name: str, enrolment_id: int) -> None:
        if self._by_form is not None:
            for form in compute_name_forms(name):
                self._by_form.setdefault(form, {})[name] = enrolment_id
