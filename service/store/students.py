"""The students of a course: found by name, enrolled when new, and refused where one cannot be told from another.

What a name comes to is ``submissions.names``'; what a student submits is ``intake.py``'s.
"""

from __future__ import annotations

import unicodedata
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.models import Enrolment, Person
from service.store.states import Role
from sim.errors import UsageError
from submissions.names import cannot_be_told, forms, shown_name
from submissions.raw_files import shown


class Students:
    """The students of one course, in one transaction that has locked it."""

    def __init__(self, session: Session, course_id: int) -> None:
        self._session = session
        self._course_id = course_id
        self._by_form: dict[str, dict[str, int]] | None = None

    def enrol(self, written: str, at: datetime) -> int:
        """The enrolment of the student who is written so, new if there is none.

        One who is written otherwise than in the normal form is only who was first written so. Raises UsageError for a
        name that is nobody's, or cannot be told from another student's.
        """
        name, written = shown_name(written), unicodedata.normalize("NFC", written)
        if not name:
            raise UsageError("this names no student, expected a name that can be seen.")
        query = select(Enrolment.id, Person).join(Person, Enrolment.person_id == Person.id)
        found = self._session.execute(
            query.where(Enrolment.course_id == self._course_id, Enrolment.student == name)
        ).one_or_none()
        if found is None:
            others = self._near(name)
            # What was enrolled before there was one normal form may have blanks round it.
            same = [enrolment_id for other, enrolment_id in others.items() if shown_name(other) == name]
            if len(same) == 1:
                return same[0]
            if not others:
                return self._new(name, written, at)
        else:
            enrolment_id, person = found
            others = {name: enrolment_id}
            if written == name:
                person.name = name
            if written == person.name:
                return enrolment_id
        raise UsageError(
            f'"{shown(written)}" {cannot_be_told(list(others)[:3])}, who is in this course; '
            "expected that name as it is written there, or another."
        )

    def _new(self, name: str, written: str, at: datetime) -> int:
        person = Person(name=written, created_at=at)
        self._session.add(person)
        self._session.flush()
        row = Enrolment(course_id=self._course_id, person_id=person.id, student=name, role=Role.STUDENT)
        self._session.add(row)
        self._session.flush()
        self._note(name, row.id)
        return row.id

    def _near(self, name: str) -> dict[str, int]:
        """The students, by name, that one of this name could be taken for."""
        if self._by_form is None:
            self._by_form = {}
            query = select(Enrolment.student, Enrolment.id).where(Enrolment.course_id == self._course_id)
            for student, enrolment_id in self._session.execute(query):
                self._note(student, enrolment_id)
        return {other: which for form in sorted(forms(name)) for other, which in self._by_form.get(form, {}).items()}

    def _note(self, name: str, enrolment_id: int) -> None:
        if self._by_form is not None:
            for form in forms(name):
                self._by_form.setdefault(form, {})[name] = enrolment_id
