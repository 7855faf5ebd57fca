"""Similar submissions, compared by source code and recordings. Read-only.

``service.similarity`` defines similarity; ``service.reports.view`` decides who may see it.
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

#: Maximum number of submissions compared in a request; this takes some seconds.
MOST_AT_ONCE = 300


def similarities(store: Store, lines: Sequence[JobLine], given: Path | None = None) -> list[Similarity]:
    """Return the similar submissions of each assignment of a batch.

    Ignores code given with the assignment and the code in ``given``. Only the recordings of one submission are in
    memory at a time. Raises UsageError if ``given`` cannot be read.
    """
    assignments = sorted({line.assignment for line in lines})
    return [_of_one(store, [line for line in lines if line.assignment == each], given) for each in assignments]


class SourceTexts:
    """Source files that a page quotes, read on first use."""

    def __init__(self, store: Store, lines: Sequence[JobLine]) -> None:
        self._store = store
        self._jobs = {(line.assignment, line.student): line.id for line in lines}
        self._texts: dict[str, Mapping[str, str]] = {}

    def of(self, assignment: str, student: str, file: str) -> str:
        """Return the text of one file of a student."""
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
