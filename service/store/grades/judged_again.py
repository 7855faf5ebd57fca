"""The marks of a regrade's earlier recordings, judged again by the release that made the new grade.

They tell a change of judging from a change of the simulation. A worker stores them beside the new grade.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from decimal import Decimal

from sqlalchemy.orm import Session

from service.store.artifacts import File, load_each_files

_NAME = "judged-again.json"

#: Marks and maximum of a criterion.
CriterionWorth = tuple[Decimal, Decimal]


@dataclass(frozen=True, slots=True)
class RejudgedMarks:
    """Marks of one criterion for the earlier recordings, judged by its old and its new table."""

    by_old_criteria: CriterionWorth
    by_new_criteria: CriterionWorth


@dataclass(frozen=True, slots=True)
class JudgedAgain:
    """The marks of the recordings of the grade ``earlier_id``, by criterion, as far as they could be judged again."""

    earlier_id: str
    marks: Mapping[str, RejudgedMarks]

    def find_marks(self, criterion: str) -> RejudgedMarks | None:
        """Return the marks of a criterion; None if it was not judged again."""
        return self.marks.get(criterion)


def build_file(judged_again: JudgedAgain) -> File:
    """Return the file that stores the marks."""
    marks = {
        name: {"old": [str(number) for number in each.by_old_criteria], "new": [str(n) for n in each.by_new_criteria]}
        for name, each in judged_again.marks.items()
    }
    document = {"earlier": judged_again.earlier_id, "marks": marks}
    return File(_NAME, "application/json", json.dumps(document).encode())


def load_judged_again(session: Session, job_ids: Collection[str]) -> dict[str, JudgedAgain]:
    """Return the stored marks by job, without jobs that have none. Executes at most one statement."""
    if not job_ids:
        return {}
    return {
        job_id: _read_file(files[_NAME])
        for job_id, files in load_each_files(session, job_ids, prefix=_NAME)
        if _NAME in files
    }


def _read_file(file: File) -> JudgedAgain:
    document = json.loads(file.data)
    marks = {
        name: RejudgedMarks(_read_worth(each["old"]), _read_worth(each["new"]))
        for name, each in document["marks"].items()
    }
    return JudgedAgain(document["earlier"], marks)


def _read_worth(numbers: list[str]) -> CriterionWorth:
    marks, max_marks = map(Decimal, numbers)
    return marks, max_marks
