"""What is alike among submissions, read from what was submitted and from its recordings. Only reads.

What is alike is decided in ``service.similarity``, who may see it in ``service.reports.view``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from service.similarity.behaviour import behaviour_of
from service.similarity.pairs import Similarity, similarity
from service.similarity.sources import given_with, sources_of
from service.similarity.writing import source_of
from service.store.batches import intake
from service.store.batches.batches import JobLine
from service.store.engine import Store
from service.store.grades import current, results

#: Submissions that are compared while somebody waits for the answer; it takes some seconds.
MOST_AT_ONCE = 300


def similarities(store: Store, lines: Sequence[JobLine], given: Path | None = None) -> list[Similarity]:
    """For each assignment of a batch what is alike; its code that was given, and that in ``given``, is left out.

    The recordings of one submission at a time are in memory. Raises UsageError where ``given`` cannot be read.
    """
    assignments = sorted({line.assignment for line in lines})
    return [_of_one(store, [line for line in lines if line.assignment == each], given) for each in assignments]


class SourceTexts:
    """The sources that a page quotes, read when the first is asked for."""

    def __init__(self, store: Store, lines: Sequence[JobLine]) -> None:
        self._store = store
        self._jobs = {(line.assignment, line.student): line.id for line in lines}
        self._texts: dict[str, Mapping[str, str]] = {}

    def of(self, assignment: str, student: str, file: str) -> str:
        """The text of one file of a student's."""
        if not self._texts:
            with self._store.reading() as session:
                each = intake.load_each_submission(session, self._jobs.values())
                self._texts = {job_id: sources_of(submission) for job_id, submission in each}
        return self._texts[self._jobs[assignment, student]][file]


def _of_one(store: Store, lines: Sequence[JobLine], given: Path | None) -> Similarity:
    graded = [line.id for line in lines if current.is_trusted(line)]
    with store.reading() as session:
        assignment = intake.load_assignment(session, lines[0].id)
        left_out = given_with(assignment, given)
        submissions = intake.load_each_submission(session, [line.id for line in lines])
        texts = {job_id: sources_of(submission) for job_id, submission in submissions}
        trials = results.load_each_trials(session, graded)
        behaved = {job_id: behaviour_of(of_job) for job_id, of_job in trials}
    sources = [source_of(line.student, file, text) for line in lines for file, text in texts[line.id].items()]
    behaviours = {line.student: behaved[line.id] for line in lines if line.id in behaved}
    return similarity(assignment.id, sources, left_out, behaviours)
