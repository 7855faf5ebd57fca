"""Measures that the assignments of a batch rank, read from its grades: one table per criterion. Read-only.

``service.grading.ranks`` computes places, ties and intervals.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.grading.ranks import RankTable, StudentMeasures, rank_students
from service.store.batches.job_lines import JobLine
from service.store.codec import decode
from service.store.courses.assignment_versions import assignment_from_bytes
from service.store.grades import current_grades, overrides
from service.store.tables.courses import AssignmentVersion
from service.store.tables.grades import CriterionResultRow
from service.store.tables.submissions import Job

if TYPE_CHECKING:
    from submissions.criteria.timing import Ranking

#: Number of jobs per query: databases limit the number of parameters.
_CHUNK_SIZE = 1000


def build_rank_tables(session: Session, lines: Sequence[JobLine]) -> list[RankTable]:
    """Return the rank tables of the graded jobs that are not excused and not staff-only."""
    graded_lines = [line for line in lines if current_grades.is_for_students(line)]
    rankings_by_key: dict[tuple[str, str], Ranking] = {}
    for content in _load_contents(session, graded_lines):
        # Most assignments rank nothing, and decoding one takes longer than everything else here.
        if b'"ranking"' in zlib.decompress(content):
            from submissions.criteria.timing import Ranking

            assignment = assignment_from_bytes(content)
            rankings = (each for each in assignment.criteria if isinstance(each, Ranking))
            rankings_by_key |= {(assignment.id, ranking.id): ranking for ranking in rankings}
    return [
        _build_table(session, assignment, ranking, [line for line in graded_lines if line.assignment == assignment])
        for (assignment, _), ranking in rankings_by_key.items()
    ]


def _split_lines(lines: Sequence[JobLine]) -> Iterator[dict[str, JobLine]]:
    for start in range(0, len(lines), _CHUNK_SIZE):
        yield {line.id: line for line in lines[start : start + _CHUNK_SIZE]}


def _load_contents(session: Session, lines: Sequence[JobLine]) -> Iterator[bytes]:
    """Yield the content of each assignment version of these jobs once."""
    versions: set[int] = set()
    for jobs in _split_lines(lines):
        versions.update(session.scalars(select(Job.assignment_version_id).where(Job.id.in_(jobs)).distinct()))
    for version in sorted(versions):
        yield from session.scalars(select(AssignmentVersion.content).where(AssignmentVersion.id == version))


def _build_table(session: Session, assignment: str, ranking: Ranking, lines: Sequence[JobLine]) -> RankTable:
    from service.grading.grade import Evidence

    measures, unit = [], ""
    for jobs in _split_lines(lines):
        rows = session.execute(
            select(CriterionResultRow.job_id, CriterionResultRow.evidence).where(
                CriterionResultRow.job_id.in_(jobs), CriterionResultRow.criterion == ranking.id
            )
        )
        overrides_by_job = overrides.load_overrides(session, list(jobs))
        for job_id, encoded_evidence in rows:
            override = overrides_by_job.get(job_id, {}).get(ranking.id)
            if override is not None and override.marks is None:
                continue
            evidence = decode(tuple[Evidence, ...], encoded_evidence)
            matching_measures = [
                measure for each in evidence for measure in each.measures if measure.name == ranking.measure
            ]
            unit = next((measure.unit for measure in matching_measures), unit)
            values = tuple(measure.value for measure in matching_measures)
            measures.append(StudentMeasures(jobs[job_id].student, values, len(evidence)))
    return RankTable(assignment, ranking.title, ranking.measure, unit, rank_students(measures, highest=ranking.highest))
